"""A sentence about parts whose files round coordinates, and the allowance of contact for it."""

import numpy as np

from tolcontact.discretization.nominal import Nominal
from tolcontact.geometry.triangle_mesh import coordinate_error, coordinate_spacing
from tolcontact.texts import shown
from tolcontact.vocabulary import STATED_ERROR_SHARE

NOTICED_SHARE = 0.01  # of the error of a pair: a smaller error of one of its parts is not stated
MAX_NAMES = 6  # of parts; how many there are beyond is a number


def coordinates_in_words(nominal: Nominal) -> str:
    """Return the coordinate spacing of parts in contact, and the allowance of contact for it; empty if it hardly matters."""
    least = STATED_ERROR_SHARE * nominal.assembly.smallest_zone()
    stated = [pair for pair in nominal.pairs if pair.coordinate_error > least]
    if not stated:
        return ""
    names: dict[str, list[str]] = {}
    for pair in stated:
        for part in (nominal.parts[index] for index in (pair.moving, pair.reference) if index is not None):
            if coordinate_error(part.mesh) > NOTICED_SHARE * pair.coordinate_error:
                of_spacing = names.setdefault(f"{coordinate_spacing(part.mesh).max():.2g} mm", [])
                if part.name not in of_spacing:
                    of_spacing.append(part.name)
    (spacing, first), *others = names.items()
    stored = f"coordinates of {_listed(first)} are stored to {spacing}"
    stored += "".join(f", of {_listed(others)} to {spacing}" for spacing, others in others)
    errors = np.array([pair.coordinate_error for pair in stated])
    most = "" if np.ptp(errors) < NOTICED_SHARE * errors.max() else "up to "
    return f"{stored}; contact allows {most}{errors.max():.2g} mm"


def _listed(names: list[str]) -> str:
    """Return names of parts as a list in words."""
    quoted = [f'"{shown(name)}"' for name in names[:MAX_NAMES]]
    if len(names) > MAX_NAMES:
        quoted.append(f"{len(names) - MAX_NAMES} other parts")
    return " and ".join([", ".join(quoted[:-1]), quoted[-1]] if len(quoted) > 1 else quoted)
