"""Doubts about units: files of triangles do not say in what they count, and a model may say it wrongly."""

import itertools
import warnings
from collections.abc import Iterator, Mapping

import numpy as np

from tolcontact.assembly import Assembly, Mesh, Part
from tolcontact.assembly.geometry import UNITS
from tolcontact.discretization.reading import Shape
from tolcontact.errors import UnitsWarning

PLAUSIBLE = (1.0, 10_000.0)  # size of a part [mm]
UNLIKE = 10.0  # ratio of sizes of parts that touch


def warn_of_units(assembly: Assembly, shapes: Mapping[Part, Shape]) -> None:
    """Warn of meshes whose size is strange: beside the points declared on them, or, where nobody stated units, by itself or
    beside a part that they touch.
    """
    for part, shape in shapes.items():
        if isinstance(part.geometry, Mesh):
            size = float(shape.mesh.scale)
            doubts = itertools.chain(_far_points(assembly, part, shape), _strange_sizes(assembly, part, shapes))
            for doubt in itertools.islice(doubts, 1):
                warnings.warn(
                    f'part "{part.name}" ({part.declared_at}): {part.geometry} is {size:.4g} mm across, {doubt}; if its file '
                    f'counts otherwise, say so: tc.Mesh(..., units="in") makes it {_in_inches(part.geometry, size):.4g} mm',
                    UnitsWarning,
                    stacklevel=4,
                )


def _in_inches(geometry: Mesh, size: float) -> float:
    by_custom = "m" if str(geometry.source).lower().endswith((".glb", ".gltf")) else "mm"
    return size * UNITS["in"] / UNITS[geometry.units or by_custom]


def _far_points(assembly: Assembly, part: Part, shape: Shape) -> Iterator[str]:
    location = assembly.location_of(part)
    scheme = location.scheme if location and isinstance(location.scheme, tuple) else ()
    declared = [
        *((f'its locator "{locator.name}"', locator.point) for locator in scheme),
        *((f'the point of measure "{m.name}"', p.position) for m in assembly.measures for p in m.points if p.part is part),
        *((f'the point of force "{f.name}"', f.at.position) for f in assembly.forces if f.at.part is part),
    ]
    lower, upper = shape.mesh.bounds
    for what, point in declared:
        away = float(np.linalg.norm(np.maximum(0, np.maximum(lower - point, point - upper))))
        if away > shape.mesh.scale:
            yield f"but {what} lies {away:.4g} mm away from it"


def _strange_sizes(assembly: Assembly, part: Part, shapes: Mapping[Part, Shape]) -> Iterator[str]:
    if not shapes[part].unsure:
        return
    size = float(shapes[part].mesh.scale)
    if not PLAUSIBLE[0] <= size <= PLAUSIBLE[1]:
        yield "which is unusual"
    sides = [(pair.moving.part, pair.reference.part) for pair in assembly.pairs]
    for other in [b if a is part else a for a, b in sides if part in (a, b)]:
        if other in shapes:
            beside = float(shapes[other].mesh.scale)
            if max(size, beside) > UNLIKE * min(size, beside):
                yield f'but "{other.name}", which it touches, {beside:.4g} mm'
