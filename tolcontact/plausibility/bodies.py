"""Bodies that interfere: nominally, or in some draws without a declared contact that keeps them apart."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.declaration import Part
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.features.feature_geometry import CylinderFeature
from tolcontact.geometry.nearest_elements import SolidBody, common_ball
from tolcontact.interference import Clash
from tolcontact.plausibility.suggested_lines import ClashPlace, contact_line, moving_first, overlap_line
from tolcontact.plausibility.trial_draws import TrialDraws
from tolcontact.vocabulary import CORRECTED, Status

MIN_THICKNESS_SHARE = 0.02  # of the thinner body: thinner overlaps are not looked for
FACET_FACTOR = 2.0  # times the height of round faces over their triangles
MAX_COMPARED = 1000  # pairs of bodies whose boxes overlap
MIN_SHARE = 0.005  # of the draws
MIN_MEASURED = 8  # draws whose depth of a clash is measured
MAX_TRIANGLES = 20_000  # of both bodies, in all of these draws, if there are more of them
MAX_RESOLVED = 8  # draws that are resolved to see whether two bodies still interfere beyond the chosen faces
MAX_OVERLAPS = 5  # of bodies that have a sentence each
MAX_CLASHES = 20  # pairs of parts that are named


@dataclass(frozen=True, eq=False)
class MeasuredClash:
    """Two bodies that interfere in some draws.

    share    of the draws
    depths   (m,) [mm], of some of these draws, the deepest one first
    places   of these draws
    """

    share: float
    depths: Float[Array, " m"]
    places: list[ClashPlace]


def clashes(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each two parts without declared contact that interfere in some draws.

    Parts that contact moves are judged at their poses with contact.
    """
    nominal, watch = draws.program.nominal, draws.program.watch
    declared = {_parts(nominal, pair) for pair in watch.declared}
    reported = set[frozenset[Part]]()
    for clash in draws.clashes:
        parts = _parts(nominal, clash.pair)
        if parts in reported or parts in declared or clash.pair in watch.overlapping or _is_carried(nominal, clash.pair):
            continue
        if any(nominal.may_differ(body) for body in clash.pair):
            measured = _measured(draws, clash.pair, _rows_with_contact(draws, clash.pair), draws.resolved.poses[:, CORRECTED])
        else:
            measured = _measured(draws, clash.pair, clash.rows, draws.poses)
        if measured.share <= MIN_SHARE:
            continue
        reported.add(parts)
        if len(reported) > MAX_CLASHES:
            yield f"more than {MAX_CLASHES} pairs of parts lie in each other without contact; declare their contact first"
            return
        moving, reference = moving_first(nominal, clash.pair)
        location = nominal.assembly.location_of(moving.part)
        basis = ", its support," if location is not None and location.parent is reference.part else ""
        yield (
            f'{moving.part.designation}: it lies in part "{reference.name}"{basis} in {_extent(draws, measured, 0)}, '
            f"and no contact holds them apart; declare it: {contact_line(nominal, clash.pair, measured.places[0])}, "
            f"or say that it is meant: {overlap_line(nominal, clash.pair)}"
        )


def clashes_beyond_faces(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each two parts with declared contact that still interfere beyond the chosen faces."""
    nominal, watch = draws.program.nominal, draws.program.watch
    if not draws.program.method.is_bounded:
        return
    for clash in draws.clashes:
        if clash.pair not in watch.declared or clash.pair in watch.overlapping:
            continue
        faces = _chosen_faces(nominal, clash.pair)
        if not any(place.is_beyond(faces) for place in _measured(draws, clash.pair, clash.rows, draws.poses).places):
            continue
        # A draw that conflicts may take a second, and a few draws suffice.
        few = draws.some(clash.rows[:: -(-len(clash.rows) // MAX_RESOLVED)])
        rows = _rows_with_contact(few, clash.pair)
        rows = rows[few.resolved.status[rows] == Status.DOUBTFUL]
        measured = _measured(few, clash.pair, rows, few.resolved.poses[:, CORRECTED])
        beyond = [k for k, place in enumerate(measured.places) if place.is_beyond(faces)]
        if measured.share > MIN_SHARE and beyond:
            parts = _parts(nominal, clash.pair)
            moving, reference = moving_first(nominal, clash.pair)
            pairs = (pair for pair in nominal.assembly.pairs if {pair.moving.part, pair.reference.part} == parts)
            pair = next(pairs, None)  # parts that touch only at supports have none
            designation, where = (moving.part.designation, "supports") if pair is None else (pair.designation, "chosen faces")
            yield (
                f'{designation}: part "{moving.name}" still lies in part "{reference.name}" beyond the '
                f"{where} in {_extent(few, measured, beyond[0], 'draws that interfere without contact')}; "
                f"declare their contact there, too: "
                f"{contact_line(nominal, clash.pair, measured.places[beyond[0]])}, or say that it is meant: "
                f"{overlap_line(nominal, clash.pair)}"
            )


def _parts(nominal: Nominal, pair: tuple[int, int]) -> frozenset[Part]:
    return frozenset(nominal.parts[body].part for body in pair)


def _is_carried(nominal: Nominal, pair: tuple[int, int]) -> bool:
    """Return whether two bodies belong to one joint, so that an earlier station determines their relative pose."""
    first, second = ((k, nominal.parts[k]) for k in pair)
    roots = [part.parent if part.carried is not None else number for number, part in (first, second)]
    return roots[0] == roots[1]


def _rows_with_contact(draws: TrialDraws, pair: tuple[int, int]) -> Int[Array, " k"]:
    """Return the draws (k,) with interference of two bodies after contact has moved them."""
    clashes = draws.program.watch.clashes(draws.resolved.poses[:, CORRECTED], draws.deviations, among=[pair])
    return next((clash.rows for clash in clashes), np.zeros(0, dtype=int))


def _measured(
    draws: TrialDraws, pair: tuple[int, int], rows: Int[Array, " k"], poses: Float[Array, "n part 12"]
) -> MeasuredClash:
    """Return where two bodies interfere at poses (n, part, 12) of draws, rows (k,), and how deep in some of them."""
    watch = draws.program.watch
    triangles = sum(len(draws.program.nominal.parts[body].mesh.faces) for body in pair)
    count = min(len(rows), max(MIN_MEASURED, MAX_TRIANGLES // triangles))
    chosen = rows[np.linspace(0, len(rows) - 1, count).round().astype(int)]
    interference = watch.measured(Clash(pair, chosen), poses, draws.deviations)
    order = np.argsort(-interference.depths, kind="stable")
    places = [ClashPlace.of(watch, pair, interference, row) for row in order]
    return MeasuredClash(len(rows) / max(len(draws.deviations), 1), interference.depths[order], places)


def _chosen_faces(nominal: Nominal, pair: tuple[int, int]) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the triangles of both bodies that each of their contact pairs chose."""
    faces = []
    for declared in nominal.assembly.pairs:
        of_part = {face.part: np.array(nominal.triangles(face)) for face in (declared.moving, declared.reference)}
        first, second = (of_part.get(nominal.parts[body].part) for body in pair)
        if first is not None and second is not None:
            faces.append((first, second))
    return faces


def _extent(draws: TrialDraws, measured: MeasuredClash, row: int, tried: str = "draws") -> str:
    """Return in how many of the tried draws bodies interfere, how deep, and where."""
    place = ", ".join(f"{c + 0.0:.4g}" for c in measured.places[row].position.round(6))
    share = f"{100 * measured.share:.2g} %" if measured.share < 1 else "all"
    return f"{share} of {len(draws.deviations)} {tried}, up to {measured.depths[row]:.2g} mm, near ({place})"


def body_overlaps(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each two bodies without a contact pair that overlap in the nominal assembly."""
    nominal = draws.program.nominal
    parts = [part.part for part in nominal.parts]
    known = {frozenset((parts[pair.moving], parts[pair.reference])) for pair in nominal.pairs if pair.reference is not None}
    meant = [frozenset(overlap.parts) for overlap in nominal.assembly.overlaps]
    bodies = [SolidBody(part.body) for part in nominal.parts]
    bounds = np.array([body.bounds for body in bodies]).reshape(-1, 2, 3)
    thickness = (bounds[:, 1] - bounds[:, 0]).min(axis=1)
    common = np.minimum(bounds[:, None, 1], bounds[None, :, 1]) - np.maximum(bounds[:, None, 0], bounds[None, :, 0])
    min_overlap = MIN_THICKNESS_SHARE * np.minimum(thickness[:, None], thickness[None])
    candidates = np.argwhere(np.triu((common > min_overlap[..., None]).all(axis=2), 1))
    overlaps = list[tuple[int, int, str]]()
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
            sentence = (
                f'{nominal.parts[i].part.designation}: it overlaps part "{nominal.parts[j].name}" by about '
                f"{diameter:.2g} mm near ({', '.join(f'{c:.4g}' for c in place)}) in the nominal assembly, and they are no "
                "contact pair; check their places, declare their contact, or say that it is meant: assembly.may_overlap(...)"
            )
            overlaps.append((i, j, sentence))
    if len(overlaps) <= MAX_OVERLAPS:
        yield from (sentence for *_, sentence in overlaps)
    else:
        bodies_in = sorted({index for *pair, _ in overlaps for index in pair})
        unplaced = sum(nominal.parts[index].part.at == (0.0, 0.0, 0.0) for index in bodies_in)
        advice = f"{unplaced} of them lie at the origin: give them their places" if unplaced > 1 else "check their places"
        yield (
            f"{len(bodies_in)} parts without contact pairs overlap in {len(overlaps)} places of the nominal assembly, "
            f'for example "{nominal.parts[overlaps[0][0]].name}" and "{nominal.parts[overlaps[0][1]].name}"; {advice}, '
            "part(..., at=(x, y, z)), or say that it is meant: assembly.may_overlap(...)"
        )


def _is_press_fit(nominal: Nominal, left: NominalPart, right: NominalPart, diameter: float, place: np.ndarray) -> bool:
    """Return whether two parts overlap at the wall of a hole of one that the other is located in.

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
