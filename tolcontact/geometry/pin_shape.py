"""The triangles of a pin, in its own frame. Lengths in mm."""

import trimesh

from tolcontact.declaration import Pin

SECTIONS = 72  # triangles around it
HEAD_WIDTH, HEAD_HEIGHT = 1.6, 0.65  # times the diameter, as for hexagon head bolts to ISO 4014


def pin_shape(pin: Pin) -> trimesh.Trimesh:
    """Return the closed surface of a pin; a head is round."""
    radius, profile = pin.diameter / 2, [(0.0, -pin.length), (pin.diameter / 2, -pin.length), (pin.diameter / 2, 0.0)]
    if pin.head:
        top = HEAD_HEIGHT * pin.diameter
        profile += [(HEAD_WIDTH * radius, 0.0), (HEAD_WIDTH * radius, top), (0.0, top)]
    else:
        profile += [(0.0, 0.0)]
    return trimesh.creation.revolve(profile, sections=SECTIONS)
