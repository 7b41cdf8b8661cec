"""How deep bodies may penetrate each other in an answer, where their contact is not that of the bodies themselves."""

import itertools
from collections.abc import Iterator, Mapping

import numpy as np

from tolcontact.compilation.bounded_pairs import Trial
from tolcontact.discretization import Nominal
from tolcontact.geometry.meeting import Meeting
from tolcontact.interference import ordered

PLANES_FACTOR = 3.0  # times the error that a trial allows: allowed penetration of faces on fixed planes


def allowed_depths(
    nominal: Nominal, meetings: Mapping[int, Meeting], trials: Mapping[int, Trial]
) -> dict[tuple[int, int], float]:
    """Return the allowed penetration [mm] of bodies of contact pairs, where it exceeds the default.

    Fixed planes err by the error allowed in their trial, at raw poses; other contact tilts parts more. Faces on springs
    penetrate each other, and form is not part of a solid. Parts that are declared to overlap may penetrate to any depth. Bodies
    in the watch have flat planes, but fixed contact points lie on triangles, with coordinates rounded by the file.
    """
    depths = dict[tuple[int, int], float]()
    for k, pair in enumerate(nominal.pairs):
        if pair.reference is not None and pair.moving_face is not None:
            bodies = ordered(pair.moving, pair.reference)
            is_free = pair.is_springy or pair.has_form
            is_fixed = k in trials and k not in meetings and np.isfinite(trials[k].allowed)
            planes = PLANES_FACTOR * trials[k].allowed if is_fixed else 0.0
            rounding = 0.0 if k in meetings else pair.coordinate_error
            depths[bodies] = max(depths.get(bodies, 0.0), np.inf if is_free else planes + rounding)
    return depths | dict.fromkeys(_declared_overlaps(nominal), np.inf)


def _declared_overlaps(nominal: Nominal) -> Iterator[tuple[int, int]]:
    """Yield the pairs of bodies, of one station, that are declared to overlap."""
    for overlap in nominal.assembly.overlaps:
        indices = [index for index, part in enumerate(nominal.parts) if part.part in overlap.parts]
        for left, right in itertools.combinations(indices, 2):
            if nominal.parts[left].station == nominal.parts[right].station:
                yield left, right
