"""Doubts about units: files of triangles do not say in what they count."""

import warnings
from collections.abc import Iterator, Mapping

from tolcontact.assembly import Assembly, Part
from tolcontact.discretization.solids import Shape
from tolcontact.errors import UnitsWarning

PLAUSIBLE = (1.0, 10_000.0)  # size of a part [mm]
UNLIKE = 10.0  # ratio of sizes of parts that touch


def warn_of_units(assembly: Assembly, shapes: Mapping[Part, Shape]) -> None:
    """Warn of parts whose size, taken in mm for want of a word, is strange by itself or beside a part that they touch."""
    for part, shape in shapes.items():
        if shape.unsure:
            size = float(shape.mesh.scale)
            for doubt in _doubts(assembly, part, size, shapes):
                warnings.warn(
                    f'part "{part.name}" ({part.declared_at}): {part.geometry} is {size:.4g} mm across, {doubt}; if it '
                    f'counts in inches, say tc.Mesh(..., units="in"), which makes it {25.4 * size:.4g} mm; units="mm" '
                    "confirms what is taken now",
                    UnitsWarning,
                    stacklevel=4,
                )
                break


def _doubts(assembly: Assembly, part: Part, size: float, shapes: Mapping[Part, Shape]) -> Iterator[str]:
    if not PLAUSIBLE[0] <= size <= PLAUSIBLE[1]:
        yield "which is unusual"
    sides = [(pair.moving.part, pair.reference.part) for pair in assembly.pairs]
    for other in [b if a is part else a for a, b in sides if part in (a, b)]:
        if other in shapes:
            beside = float(shapes[other].mesh.scale)
            if max(size, beside) > UNLIKE * min(size, beside):
                yield f'but "{other.name}", which it touches, {beside:.4g} mm'
