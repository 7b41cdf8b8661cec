"""Locators as contact pairs: the one-sided locators of a part, and each two-sided locator that gives way."""

from collections.abc import Iterator, Sequence

import numpy as np

from tolcontact.declaration import Part
from tolcontact.discretization.locators import Locators, NominalPart
from tolcontact.discretization.nominal import ContactPoints
from tolcontact.discretization.offsets import Offsets
from tolcontact.discretization.scenes import Scene


def supports_name(scene: Scene, part: Part) -> str:
    """Return the name of the pair of the one-sided locators of a part."""
    return f"supports of {part.name}" + (f" in {scene.station}" if scene.station else "")


def support_pairs(parts: tuple[NominalPart, ...], scenes: Sequence[Scene]) -> Iterator[ContactPoints]:
    """Yield the one-sided locators of each free part, or of each part of a free joint, as a contact pair; then its springs."""
    start = 0
    for index, part in enumerate(parts):
        owners = np.array(part.owners or (index,) * len(part.locators), dtype=int)
        for owner in np.unique(owners[part.locators.one_sided]) if part.free else ():
            supports = np.flatnonzero(part.locators.one_sided & (owners == owner))
            P, n = part.locators.points[supports], part.locators.directions[supports]
            offsets = _support_offsets(part.locators, start, supports)
            scene = next(scene for scene in scenes if scene.station == part.station)
            name = supports_name(scene, parts[owner].part)
            stiffness = np.where(part.locators.springy, part.locators.stiffness, np.inf)[supports]
            numbers = start + supports
            yield ContactPoints(name, int(owner), part.parent, P, P, n, offsets, locators=numbers, stiffness=stiffness)
        for number in np.flatnonzero(part.locators.springy & ~part.locators.one_sided) if part.free else ():
            yield _spring_pair(part, int(owners[number]), start, int(number))
        start += len(part.locators)


def _spring_pair(part: NominalPart, owner: int, start: int, number: int) -> ContactPoints:
    """Return a two-sided locator that gives way, as the pair of a spring that pushes and one that pulls, at the same point."""
    locators, twice = part.locators, np.array([number, number])
    P, signs = locators.points[twice], np.array([1.0, -1.0])
    heights = _support_offsets(locators, start, twice[:1])
    offsets = Offsets(heights.columns, heights.matrix * signs)
    return ContactPoints(
        locators.labels[number], owner, part.parent, P, P, signs[:, None] * locators.directions[twice], offsets,
        locators=start + twice, stiffness=locators.stiffness[twice], pulls=signs < 0,
    )  # fmt: skip


def _support_offsets(locators: Locators, start: int, supports: np.ndarray) -> Offsets:
    """Return the heights of supports: their own deviations, columns `start` on, and those of the faces they stand against."""
    offsets = [Offsets(start + supports, np.eye(len(supports)))]
    for place, number in enumerate(supports):
        columns, factors = locators.pushes(number)
        if columns.size:
            matrix = np.zeros((len(columns), len(supports)))
            matrix[:, place] = factors
            offsets.append(Offsets(columns, matrix))
    return Offsets.joined(offsets, len(supports)) if len(offsets) > 1 else offsets[0]
