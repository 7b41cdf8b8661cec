"""Bodies that lie in each other, and are no contact pair."""

import itertools
from collections.abc import Iterator

import numpy as np

from tolcontact.discretization import Nominal, NominalPart
from tolcontact.errors import designation
from tolcontact.features.feature_geometry import CylinderFeature
from tolcontact.geometry.body_overlap import SolidBody, common_ball
from tolcontact.plausibility.trial_draws import TrialDraws

MIN_SHARE = 0.02  # of the thinner body: thinner overlaps are not looked for
FACET_FACTOR = 2.0  # times the height of round faces over their triangles
MAX_COMPARED = 1000  # pairs of bodies whose boxes overlap


def body_overlaps(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each two bodies without a contact pair that overlap in the nominal assembly."""
    nominal = draws.program.nominal
    parts = [part.part for part in nominal.parts]
    known = {frozenset((parts[pair.moving], parts[pair.reference])) for pair in nominal.pairs if pair.reference is not None}
    meant = [frozenset(overlap.parts) for overlap in nominal.assembly.overlaps]
    bodies = [SolidBody(part.body) for part in nominal.parts]
    bounds = np.array([body.bounds for body in bodies])
    thickness = (bounds[:, 1] - bounds[:, 0]).min(axis=1)
    common = np.minimum(bounds[:, None, 1], bounds[None, :, 1]) - np.maximum(bounds[:, None, 0], bounds[None, :, 0])
    min_overlap = MIN_SHARE * np.minimum(thickness[:, None], thickness[None])
    candidates = np.argwhere(np.triu((common > min_overlap[..., None]).all(axis=2), 1))
    for i, j in itertools.islice(candidates, MAX_COMPARED):
        is_known = nominal.parts[i].station != nominal.parts[j].station or {parts[i], parts[j]} in known
        is_known = is_known or any({parts[i], parts[j]} <= overlap for overlap in meant)
        if is_known or not (bodies[i].is_closed and bodies[j].is_closed):
            continue
        known.add(frozenset((parts[i], parts[j])))
        facets = FACET_FACTOR * (bodies[i].facet_height + bodies[j].facet_height)
        ball = common_ball(bodies[i], bodies[j], max(float(min_overlap[i, j]), facets))
        if ball is not None and not _is_press_fit(nominal, nominal.parts[i], nominal.parts[j], *ball):
            diameter, place = ball
            yield (
                f'{designation("part", nominal.parts[i].part)}: it overlaps part "{nominal.parts[j].name}" by about '
                f"{diameter:.2g} mm near ({', '.join(f'{c:.4g}' for c in place)}) in the nominal assembly, and they are no "
                "contact pair; check their places, declare their contact, or say that it is meant: assembly.may_overlap(...)"
            )


def _is_press_fit(nominal: Nominal, left: NominalPart, right: NominalPart, diameter: float, place: np.ndarray) -> bool:
    """Return whether the ball in which two parts overlap lies at the wall of a hole of one that the other is located in.

    A screw is thicker than its thread, and a dowel than its hole.
    """
    grounds = [
        (location.on, ground)
        for location in nominal.assembly.locations
        for located, ground in ((left, right), (right, left))
        if location.part is located.part and location.station == located.station and location.parent is ground.part
    ]
    for feature in nominal.features:
        for ground_feature, ground in grounds:
            hole = feature.geometry
            if feature.feature is ground_feature and isinstance(hole, CylinderFeature) and hole.is_inner:
                R_WP, t_WP = ground.placement
                arm = (place - t_WP) @ R_WP - hole.centre
                station = float(arm @ hole.axis)
                distance = float(np.linalg.norm(arm - station * hole.axis))
                if abs(distance - hole.size / 2) <= diameter and abs(station) <= hole.half + diameter:
                    return True
    return False
