"""The shape of a fastener that is known by its diameter: a shank, and a head if it has one. Own frame, mm."""

import trimesh

SECTIONS = 72  # triangles around it
HEAD_WIDTH, HEAD_HEIGHT = 1.6, 0.65  # times the diameter, as of a hexagon head bolt of ISO 4014


def fastener_shape(diameter: float, length: float, *, has_head: bool) -> trimesh.Trimesh:
    """Return a shank along z from -length to 0, and the head above it."""
    radius = diameter / 2
    profile = [(0.0, -length), (radius, -length), (radius, 0.0)]
    if has_head:
        width, height = HEAD_WIDTH * radius, HEAD_HEIGHT * diameter
        profile += [(width, 0.0), (width, height), (0.0, height)]
    else:
        profile += [(0.0, 0.0)]
    return trimesh.creation.revolve(profile, sections=SECTIONS)
