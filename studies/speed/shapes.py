"""An assembly of any size: a slab on a base with so many contact points, flat or curved."""

import numpy as np
import trimesh

import tolcontact as tc

LONG, WIDE, THICK = 50.0, 25.0, 10.0


def slab(points: int, radius: float = np.inf) -> tc.Assembly:
    """Return a slab set down on a base. Both faces are part of a sphere, or flat where `radius` [mm] is infinite."""
    across = max(round(np.sqrt(points / 2)), 2)
    a = tc.Assembly(f"slab of {points}")
    base = a.part("base", tc.Mesh(_shell(LONG + 10, WIDE + 10, 60, 35, radius, -THICK)), fixed=True)
    top = a.part("slab", tc.Mesh(_shell(LONG, WIDE, max(round(points / across), 2), across, radius, THICK)))
    places = {
        "Z1": ((-20, -10, 0), "z", 2), "Z2": ((20, -10, 0), "z", 2), "Z3": ((0, 10, 0), "z", 2),
        "Y1": ((-20, 0, 5), "y", 0.5), "Y2": ((20, 0, 5), "y", 0.5), "X1": ((0, 0, 5), "x", 0.5),
    }  # fmt: skip
    a.locate(top, [tc.Locator(name, *place) for name, place in places.items()])
    a.contact("interface", moving=top.face(_contact_side), reference=base.face(_contact_side), points="vertices", within=0.5)
    a.measure("corner", top.point(LONG / 2, WIDE / 2, THICK), along="z", tolerance=1)
    return a


def _shell(long: float, wide: float, along: int, across: int, radius: float, thickness: float) -> trimesh.Trimesh:
    """Return the body between the sphere and a plane at height `thickness`."""
    x, y = (each.ravel() for each in np.meshgrid(np.linspace(-0.5, 0.5, along) * long, np.linspace(-0.5, 0.5, across) * wide))
    z = radius - np.sqrt(radius**2 - x**2 - y**2) if np.isfinite(radius) else np.zeros_like(x)
    first = (np.arange(across - 1)[:, None] * along + np.arange(along - 1)).ravel()
    sheet = np.concatenate([np.column_stack([first, first + 1, first + along]),
                            np.column_stack([first + 1, first + along + 1, first + along])])  # fmt: skip
    count = along * across
    right, back, left = (
        np.arange(2 * along - 1, count, along),
        np.arange(count - 2, count - along - 1, -1),
        np.arange(count - 2 * along, 0, -along),
    )
    edge = np.concatenate([np.arange(along), right, back, left])
    after = np.roll(edge, -1)
    wall = np.concatenate([np.column_stack([edge, edge + count, after]), np.column_stack([after, edge + count, after + count])])
    vertices = np.concatenate([np.column_stack([x, y, z]), np.column_stack([x, y, np.full(count, thickness)])])
    mesh = trimesh.Trimesh(vertices, np.concatenate([sheet, sheet[:, ::-1] + count, wall]), process=False)
    mesh.fix_normals()
    return mesh


def _contact_side(centres: np.ndarray, normals: np.ndarray) -> np.ndarray:
    return np.asarray((np.abs(normals[:, 2]) > 0.3) & (np.abs(centres[:, 2]) < THICK - 1e-6))
