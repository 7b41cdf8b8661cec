"""Rotations beyond a full turn, and tolerances that are wide compared with their part."""

import math
from collections.abc import Iterator

import numpy as np

from tolcontact.declaration import Size
from tolcontact.declaration.values import is_length
from tolcontact.discretization import NominalPart
from tolcontact.plausibility.declared_points import location_designation, parts_in_other_units
from tolcontact.plausibility.trial_draws import SIGMAS, TrialDraws

WIDE_SHARE = 0.5  # of a part's largest extent: the width of a zone
MAX_TILT = math.radians(45)  # by the locators, at three sigma


def rotations(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part whose rotation is more than a turn, or more than half a turn in whole numbers."""
    for nominal in draws.program.nominal.last_parts:
        rotation = np.array(nominal.part.rotation)
        angle = float(np.linalg.norm(rotation))
        if angle > 2 * math.pi * (1 + 1e-6) or (angle > math.pi * (1 + 1e-6) and (rotation == np.round(rotation)).all()):
            numbers = ", ".join(f"{component:g}" for component in rotation)
            yield (
                f"{nominal.part.designation}: its rotation ({numbers}) is in rad, a turn by {math.degrees(angle):.4g} "
                f"degrees; if these are degrees, write rotation=tc.degrees({numbers})"
            )


def wide_tolerances(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part with a zone that is wide compared with it, or with locators too close together."""
    in_other_units = parts_in_other_units(draws)
    for nominal in draws.program.nominal.parts:
        if nominal.part in in_other_units:
            continue
        place = location_designation(draws.program.nominal.assembly, nominal.part, nominal.station)
        size = float(np.ptp(nominal.mesh.bounds, axis=0).max())
        widths = _widths(nominal, place)
        owner, width = max(widths, key=lambda entry: entry[1], default=("", 0.0))
        if width > WIDE_SHARE * size:
            yield (
                f'{owner}: its tolerance of {width:.4g} mm is wide compared with part "{nominal.name}", which is {size:.4g} mm '
                "long; a tolerance is the full width of its zone, in mm"
            )
        elif fault := _tilt(nominal, place):
            yield fault


def _widths(nominal: NominalPart, place: str) -> list[tuple[str, float]]:
    """Return the declarations of a part that have zones, and the widths [mm] of these."""
    locators = zip(nominal.locators.labels, nominal.locators.tolerances, strict=True)
    widths = [(f'{place}: locator "{label.rpartition(".")[2]}"', tolerance.width) for label, tolerance in locators]
    for declared in nominal.part.toleranced:
        where = f'part "{nominal.name}": {declared.designation}'
        for tolerance in declared.tolerances:
            width = tolerance.tolerance.width if isinstance(tolerance, Size) else tolerance.width
            if is_length(width):
                widths.append((f"{where}: {tolerance.kind}", float(width)))
    return widths


def _tilt(nominal: NominalPart, place: str) -> str:
    """Return a sentence on locators that rotate their part by more than MAX_TILT; empty if they do not."""
    locators = nominal.locators
    if not len(locators):
        return ""
    matrix, _ = locators.placing_matrix
    sigmas = np.array([tolerance.width / 6 for tolerance in locators.tolerances])
    tilt = SIGMAS * float(np.sqrt(((matrix[3:] * sigmas) ** 2).sum()))
    if not tilt > MAX_TILT:
        return ""
    apart = np.linalg.norm(locators.points[:, None] - locators.points[None], axis=2)
    return (
        f"{place}: its locators turn the part by {math.degrees(tilt):.0f} degrees (3 sigma) with tolerances of up to "
        f"{6 * sigmas.max():.3g} mm; move them apart (the closest ones are {apart[apart > 0].min():.3g} mm apart), "
        "or check the tolerances, which are in mm"
    )
