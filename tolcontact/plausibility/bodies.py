"""Bodies that interfere: nominally, or in some draws without a declared contact; with lines of a script that declare one."""

import itertools
import keyword
import re
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.declaration import Part
from tolcontact.declaration.values import DIRECTIONS, direction
from tolcontact.discretization import Nominal, NominalPart
from tolcontact.features.feature_geometry import CylinderFeature
from tolcontact.geometry.analytic_surfaces import Plane
from tolcontact.geometry.body_overlap import SolidBody, common_ball
from tolcontact.geometry.brep_face import number_faces
from tolcontact.geometry.files import BREP
from tolcontact.interference import Clash, Interference, Watch
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
SAME_DIRECTION = 1e-4  # of the cosine of an angle
Faces = list[tuple[np.ndarray, np.ndarray]]  # triangles of two bodies


class ClashPlace(NamedTuple):
    """A place where two bodies interfere in a draw.

    depth       [mm]
    position    (3,) [mm] in the nominal assembly
    triangles   candidates of the mesh of each body: several at an edge and its ends
    """

    depth: float
    position: np.ndarray
    triangles: tuple[np.ndarray, ...]

    def is_beyond(self, faces: Faces) -> bool:
        """Return whether the place lies on none of some pairs of faces, triangles of both bodies."""
        first, second = self.triangles
        return not any(np.isin(first, moving).any() and np.isin(second, reference).any() for moving, reference in faces)


def clashes(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each two parts without declared contact that interfere in some draws.

    Parts that contact moves are judged at their poses with contact.
    """
    nominal, watch = draws.program.nominal, draws.program.watch
    declared = {_parts(nominal, pair) for pair in watch.declared}
    reported = set[frozenset[Part]]()
    for clash in draws.clashes:
        pair, parts = clash.pair, _parts(nominal, clash.pair)
        if parts in reported or parts in declared or pair in watch.overlapping or _is_carried(nominal, pair):
            continue
        if any(nominal.may_differ(body) for body in pair):
            share, places = _measured(draws, pair, _rows_with_contact(draws, pair), draws.resolved.poses[:, CORRECTED])
        else:
            share, places = _measured(draws, pair, clash.rows, draws.poses)
        if share <= MIN_SHARE:
            continue
        reported.add(parts)
        if len(reported) > MAX_CLASHES:
            yield f"more than {MAX_CLASHES} pairs of parts lie in each other without contact; declare their contact first"
            return
        moving, reference = _moving_first(nominal, pair)
        location = nominal.assembly.location_of(moving.part)
        basis = ", its support," if location is not None and location.parent is reference.part else ""
        yield (
            f'{moving.part.designation}: it lies in part "{reference.name}"{basis} in {_extent(draws, share, places[0])}, '
            f"and no contact holds them apart; declare it: {_contact_line(nominal, pair, places[0])}, "
            f"or say that it is meant: {_overlap_line(nominal, pair)}"
        )


def clashes_beyond_faces(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each two parts with declared contact that still interfere beyond the chosen faces."""
    nominal, watch = draws.program.nominal, draws.program.watch
    if not draws.program.method.is_bounded:
        return
    for clash in draws.clashes:
        pair = clash.pair
        if pair not in watch.declared or pair in watch.overlapping:
            continue
        faces = _chosen_faces(nominal, pair)
        _, places = _measured(draws, pair, clash.rows, draws.poses)
        if not any(place.is_beyond(faces) for place in places):
            continue
        # A draw that conflicts may take a second, and a few draws suffice.
        few = draws.some(clash.rows[:: -(-len(clash.rows) // MAX_RESOLVED)])
        rows = _rows_with_contact(few, pair)
        rows = rows[few.resolved.status[rows] == Status.DOUBTFUL]
        share, places = _measured(few, pair, rows, few.resolved.poses[:, CORRECTED])
        beyond = next((place for place in places if place.is_beyond(faces)), None)
        if share > MIN_SHARE and beyond is not None:
            parts = _parts(nominal, pair)
            moving, reference = _moving_first(nominal, pair)
            pairs = (
                declared for declared in nominal.assembly.pairs if {declared.moving.part, declared.reference.part} == parts
            )
            first = next(pairs, None)  # parts that touch only at supports have none
            designation, where = (moving.part.designation, "supports") if first is None else (first.designation, "chosen faces")
            yield (
                f'{designation}: part "{moving.name}" still lies in part "{reference.name}" beyond the '
                f"{where} in {_extent(few, share, beyond, 'draws that interfere without contact')}; "
                f"declare their contact there, too: {_contact_line(nominal, pair, beyond)}, or say that it is meant: "
                f"{_overlap_line(nominal, pair)}"
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
) -> tuple[float, list[ClashPlace]]:
    """Return the share of draws, rows (k,), in which two bodies interfere, and the places in some of them, the deepest first.

    poses   (n, part, 12) of all draws
    """
    watch = draws.program.watch
    triangles = sum(len(draws.program.nominal.parts[body].mesh.faces) for body in pair)
    count = min(len(rows), max(MIN_MEASURED, MAX_TRIANGLES // triangles))
    chosen = rows[np.linspace(0, len(rows) - 1, count).round().astype(int)]
    interference = watch.measured(Clash(pair, chosen), poses, draws.deviations)
    order = np.argsort(-interference.depths, kind="stable")
    return len(rows) / max(len(draws.deviations), 1), [_place(watch, pair, interference, row) for row in order]


def _place(watch: Watch, pair: tuple[int, int], interference: Interference, row: int) -> ClashPlace:
    sides = []
    for body, triangle in zip(pair, interference.triangles[row], strict=True):
        solid, numbers = watch.solid(body), np.array([triangle])
        assert solid is not None
        if triangle < 0:
            numbers = np.flatnonzero(np.isin(solid.faces, solid.edges[-1 - triangle]).any(axis=1))
        sides.append(solid.sources[numbers])
    return ClashPlace(float(interference.depths[row]), interference.places[row].mean(axis=0), tuple(sides))


def _chosen_faces(nominal: Nominal, pair: tuple[int, int]) -> Faces:
    """Return the triangles of both bodies that each of their contact pairs chose."""
    faces = []
    for declared in nominal.assembly.pairs:
        of_part = {face.part: np.array(nominal.triangles(face)) for face in (declared.moving, declared.reference)}
        first, second = (of_part.get(nominal.parts[body].part) for body in pair)
        if first is not None and second is not None:
            faces.append((first, second))
    return faces


def _extent(draws: TrialDraws, share: float, place: ClashPlace, tried: str = "draws") -> str:
    """Return in how many of the tried draws bodies interfere, how deep, and where."""
    position = ", ".join(f"{c + 0.0:.4g}" for c in place.position.round(6))
    in_words = f"{100 * share:.2g} %" if share < 1 else "all"
    return f"{in_words} of {len(draws.deviations)} {tried}, up to {place.depth:.2g} mm, near ({position})"


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


def _variable_of(name: str) -> str:
    """Return a variable that a script may use for a declared thing."""
    word = re.sub(r"\W+", "_", name).strip("_") or "part"
    return f"_{word}" if word[0].isdigit() or keyword.iskeyword(word) else word


def _face_line(part: NominalPart, triangle: int) -> str:
    mesh, variable = part.mesh, _variable_of(part.name)
    normal = np.asarray(mesh.face_normals)[triangle]
    if BREP in mesh.face_attributes:
        face_of, faces = number_faces(mesh)
        number = int(face_of[triangle])
        stated, names = faces[number], [face.name for face in faces]
        face = f'"{stated.name}"' if stated.name and names.count(stated.name) == 1 else str(number + 1)
        whole = "" if stated.surface is None or isinstance(stated.surface, Plane) else ", whole=True"
        return f"{variable}.face(tc.select.Brep({face}{whole}))"
    for side in DIRECTIONS:
        if normal @ np.array(direction(side)) > 1 - SAME_DIRECTION:
            return f'{variable}.face("{side}")'
    return f"{variable}.face()"


def _contact_line(nominal: Nominal, pair: tuple[int, int], place: ClashPlace) -> str:
    faces = [
        _face_line(nominal.parts[body], triangle) for body, triangle in zip(pair, _facing(nominal, pair, place), strict=True)
    ]
    is_first = _moving_first(nominal, pair)[0] is nominal.parts[pair[0]]
    moving, reference = faces if is_first else faces[::-1]
    names, title, number = {declared.name for declared in nominal.pairs}, _title(nominal, pair), 1
    while title in names:
        number += 1
        title = f"{_title(nominal, pair)} {number}"
    owner = _variable_of(nominal.parts[pair[0]].station) if nominal.parts[pair[0]].station else "assembly"
    return f'{owner}.contact("{title}", moving={moving}, reference={reference})'


def _facing(nominal: Nominal, pair: tuple[int, int], place: ClashPlace) -> tuple[int, int]:
    """Return the triangle of each body at a place that faces the other body most directly."""
    normals = [
        np.asarray(nominal.parts[body].body.face_normals)[triangles]
        for body, triangles in zip(pair, place.triangles, strict=True)
    ]
    first, second = np.unravel_index(int((normals[0] @ normals[1].T).argmin()), (len(normals[0]), len(normals[1])))
    return int(place.triangles[0][first]), int(place.triangles[1][second])


def _title(nominal: Nominal, pair: tuple[int, int]) -> str:
    return " on ".join(part.name for part in _moving_first(nominal, pair))


def _moving_first(nominal: Nominal, pair: tuple[int, int]) -> tuple[NominalPart, NominalPart]:
    """Return two bodies, the moving one first: the one with locators, or the one that is declared later."""
    first, second = (nominal.parts[body] for body in pair)
    return (first, second) if len(first.locators) and not len(second.locators) else (second, first)


def _overlap_line(nominal: Nominal, pair: tuple[int, int]) -> str:
    return f"assembly.may_overlap({', '.join(_variable_of(nominal.parts[body].name) for body in pair)})"
