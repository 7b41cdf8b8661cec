"""The 3D scenes of pages: of an archive with fields and single realizations, and of a declared assembly with features."""

import base64
from collections.abc import Iterator, Sequence
from typing import Any

import fast_simplification
import igl
import numpy as np
import xarray as xr
from scipy.spatial import cKDTree

from tolcontact import vocabulary as terms
from tolcontact.declaration import Assembly, Feature, Part, Pattern
from tolcontact.declaration.selection import Inside
from tolcontact.discretization import Nominal
from tolcontact.errors import GeometryFault
from tolcontact.geometry import PartPreview, preview
from tolcontact.geometry.faces import Meshes, triangles
from tolcontact.realizations import archived_analysis, finished
from tolcontact.report.annotations import Marks, fixed_points, marks_of, marks_of_nominal
from tolcontact.report.elastic_tables import reactions_of
from tolcontact.report.html.form_scene import MAX_GAPS, SingleStates
from tolcontact.report.html.station_scenes import Scene, station_poses, stations_of, stations_of_nominal, worst_poses
from tolcontact.statistics import touching

Packed = dict[str, Any]
MAX_TRIANGLES = 60_000  # of all bodies
MIN_TRIANGLES = 500  # of a body
MAX_EXCESS = 1.2  # ratio of triangles to the target number, above which the fast method has failed
EXTREMES = 5  # of each measure, on either side
MAX_REALIZATIONS = 300


def single_realizations(results: xr.DataTree) -> dict[int, str]:
    """Return realizations in the order of the page, with the reason to show each; extremes refer to corrected measures."""
    done = finished(results)
    measured = results.to_dataset()[terms.MEASURED.name].isel({terms.REALIZATION: slice(done), terms.STATE: terms.CORRECTED})
    reasons: dict[int, str] = {}
    for number, measure in enumerate(measured[terms.MEASURE].values):
        values = measured.isel({terms.MEASURE: number}).values  # one column at a time, since archives may be large
        order = np.argsort(values, kind="stable")
        order = order[np.isfinite(values[order])]
        for extreme, rows in (("smallest", order), ("largest", order[::-1])):
            for row in rows[:EXTREMES].tolist():
                reasons.setdefault(row, f"{extreme} {measure}")
    for row in np.random.default_rng(0).permutation(done)[: MAX_REALIZATIONS + len(reasons)].tolist():
        if len(reasons) >= MAX_REALIZATIONS:
            break
        reasons.setdefault(row, "at random")
    return dict(list(reasons.items())[:MAX_REALIZATIONS])


def packed(values: Any, kind: str = "f4") -> Packed:
    """Return an array packed as single-precision floats, "f4", or as integers, "i4"."""
    array = np.ascontiguousarray(values, dtype=f"<{kind}")
    return {"shape": list(array.shape), "kind": kind, "data": base64.b64encode(array.tobytes()).decode()}


def scene_of(results: xr.DataTree, summary: xr.Dataset) -> Scene:
    """Return the scene of an archive in the nominal assembly frame [mm], without data that the archive lacks."""
    singles = single_realizations(results)
    states = SingleStates(results, np.array(list(singles), dtype=int))
    scene = {
        "parts": _parts(results, states),
        **packed_marks(marks_of(results)),
        "realizations": _realizations(results, singles, states),
        "stations": _stations(results, states),
        "reactions": _reactions(results),
    }
    _add_contact(scene["contacts"], results, summary, states, len(singles))
    return {**scene, "reactionUnits": summary["reaction"].attrs["units"]}


def _reactions(results: xr.DataTree) -> list[Scene]:
    """Return the arrows of reactions of elastic parts: place, direction, mean, and 2.5th and 97.5th percentiles [N]."""
    arrows = []
    for reaction in reactions_of(results):
        if len(x := reaction.values):
            low, high = np.percentile(x, (2.5, 97.5)).tolist()
            place = {"pair": reaction.pair, "at": reaction.at.tolist(), "along": reaction.along.tolist()}
            arrows.append({**place, "mean": float(x.mean()), "low": low, "high": high})
    return arrows


def _add_contact(pairs: list[Scene], results: xr.DataTree, summary: xr.Dataset, states: SingleStates, count: int) -> None:
    """Add the probability of contact of each contact point, the mean reaction of each pair, and gaps between planes.

    Gaps are in `count` single realizations, with triangles between the contact points.
    """
    contact, points = touching(results) if pairs else None, sum(pair["points"]["shape"][0] for pair in pairs)
    for number, pair in enumerate(pairs):
        if contact is not None and contact.attrs["realizations"]:
            is_of_pair = contact["pair"].values == pair["name"]
            pair["touching"] = packed(contact["touching"].sel(interval="estimate").values[is_of_pair])
        mean = float(summary["reaction"].sel(pair=pair["name"], of_reaction="mean", interval="estimate"))
        pair["reaction"] = mean if np.isfinite(mean) else None
        pair["triangles"] = packed(states.triangles(number), "i4")
        gaps = states.gaps(number) if count * len(terms.STATES) * points <= MAX_GAPS else None
        pair["gapsLeft"] = None if gaps is None else packed(gaps)


def packed_marks(marks: Marks) -> Scene:
    """Return annotations by kind as the data of a page."""
    return {
        kind: [
            {key: packed(value) if isinstance(value, np.ndarray) else value for key, value in mark.items()} for mark in entries
        ]
        for kind, entries in vars(marks).items()
    }


def _parts(results: xr.DataTree, states: SingleStates) -> list[Scene]:
    fields = {name: results[terms.field_of(name)].to_dataset() for name in map(str, results.to_dataset()[terms.PART].values)}
    counts, parts = triangle_budgets([field.sizes[terms.FACE] for field in fields.values()]), []
    for (name, field), count in zip(fields.items(), counts, strict=True):
        triangles = field[terms.FIELD_FACES.name].values
        vertices, faces, nearest = coarser(field[terms.FIELD_VERTICES.name].values, triangles, count)
        part: Scene = {"name": name, "vertices": packed(vertices), "faces": packed(faces, "i4"), "triangles": len(triangles)}
        part["forms"] = [
            {"vertices": packed(form["vertices"], "i4"), "normal": form["normal"].tolist(), "modes": packed(form["modes"]),
             "coefficients": packed(form["coefficients"])}
            for form in states.forms(name, vertices, faces)
        ]  # fmt: skip
        for key, variable in (("mean", terms.FIELD_MEAN), ("sixSigma", terms.FIELD_SIX_SIGMA)):
            values = field[variable.name].values[:, nearest]
            if np.isfinite(values[..., :3]).all():
                part[key] = packed(values)
        parts.append(part)
    return parts


def _realizations(results: xr.DataTree, singles: dict[int, str], states: SingleStates) -> Scene:
    """Return archived worst cases, then single realizations; motions (realization, state, part, 12) are R - I and t."""
    rows, worst = results.to_dataset(), archived_analysis(results, terms.WORST_CASE)
    cases = [] if worst is None else [str(case).split(" ", 1) for case in worst[terms.CASE].values]
    names = [f"worst-case {terms.WORD_OF_END[end]}: {measure}" for end, measure in cases]

    def values_of(variable: terms.ArchiveVariable) -> np.ndarray:
        values = states.read(rows, variable)
        return values if worst is None else np.concatenate([worst[variable.name].values, values])

    entries: Scene = {
        "worstCases": len(names),
        "names": names + [f"realization {row} ({reason})" for row, reason in singles.items()],
        "status": [terms.STATUS_MEANINGS[status] for status in values_of(terms.STATUS)],
        "residual": packed(values_of(terms.KKT_RESIDUAL)),
        "gaps": packed(values_of(terms.GAP_MIN)),
        "measured": packed(values_of(terms.MEASURED)),
    }
    if terms.ROTATION.name in rows:
        entries["motions"] = _motions(values_of(terms.ROTATION) - np.eye(3), values_of(terms.TRANSLATION))
    return entries


def _stations(results: xr.DataTree, states: SingleStates) -> list[Scene]:
    """Return the scenes of stations, with the motions of archived worst cases, then of single realizations."""
    worst, stations = archived_analysis(results, terms.WORST_CASE), stations_of(results)
    for station in stations:
        if (poses := station_poses(results, station["name"], states)) is not None:
            cases = worst_poses(results, station["name"], worst)
            R, t = (np.concatenate(pair) for pair in zip(cases, poses, strict=True))
            station["motions"] = _motions(R - np.eye(3), t)
    return stations


def _motions(R: np.ndarray, t: np.ndarray) -> Packed:
    return packed(np.concatenate([R.reshape(*R.shape[:-2], 9), t], axis=-1))


def view_of(assembly: Assembly, nominal: Nominal | None, faults: Sequence[str]) -> Scene:
    """Return the scene. Without a `nominal` assembly, for a model with faults, it contains only parts with valid shapes."""
    marks = Marks([], [], [], [], []) if nominal is None else marks_of_nominal(nominal)
    previews = {part: image for part in assembly.parts if (image := preview(part)) is not None}
    text = "\n".join(faults)
    pairs = [pair for pair in assembly.pairs if f'"{pair.name}" (' in text]
    faulty = {face.part.name for pair in pairs for face in (pair.moving, pair.reference)}
    faulty |= {part.name for part in assembly.parts if f'part "{part.name}"' in text}
    return {
        "parts": [_drawn_part(part, image, is_faulty=part.name in faulty) for part, image in previews.items()],
        "toleranced": feature_lists(assembly, {part: image.mesh for part, image in previews.items()}),
        "stations": stations_of_nominal(nominal),
        **packed_marks(marks),
    }


def gap_rows(nominal: Nominal | None) -> list[Scene]:
    """Return the smallest and the largest gap of each pair of faces in the nominal assembly."""
    rows = []
    for pair in () if nominal is None else nominal.pairs:
        _, gaps = fixed_points(pair)
        smallest, largest = (f"{gap + 0.0:.4g}" for gap in (gaps.min(), gaps.max()))
        rows.append({"name": pair.name, "count": len(gaps), "smallest": smallest, "largest": largest})
    return rows


def _drawn_part(part: Part, image: PartPreview, *, is_faulty: bool) -> Scene:
    return {
        "name": part.name,
        "faulty": is_faulty,
        "placement": [*image.rotation.ravel().tolist(), *part.at],
        "vertices": packed(image.vertices),
        "faces": packed(image.faces, "i4"),
        "faceOfTriangle": packed(image.face_of, "i4"),
        "described": [
            {"description": str(face), "snippet": snippet, "groups": groups, "whole": face.whole or [face.number]}
            for face, snippet, groups in zip(image.descriptions, image.snippets, image.groups, strict=True)
        ],
    }


def triangle_budgets(counts: Sequence[int]) -> list[int]:
    """Return the largest number of triangles of each body."""
    share = min(1.0, MAX_TRIANGLES / max(sum(counts), 1))
    return [count if share == 1 else min(count, max(MIN_TRIANGLES, int(share * count))) for count in counts]


def coarser(vertices: np.ndarray, faces: np.ndarray, count: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return a surface of about `count` triangles: vertices (vertex, 3), faces (face, 3), and the nearest old vertices."""
    if len(faces) <= count:
        return vertices, faces, np.arange(len(vertices))
    coarse, corners = fast_simplification.simplify(vertices, faces, target_count=count)
    if len(corners) > MAX_EXCESS * count:  # short edges stop the fast method, but not this one
        coarse, corners, *_ = igl.decimate(
            np.asarray(vertices, dtype=np.float64, order="C"), np.asarray(faces, dtype=np.int64, order="C"), count
        )
    return coarse, corners, cKDTree(vertices).query(coarse)[1]


def feature_lists(assembly: Assembly, meshes: Meshes) -> list[Scene]:
    """Return the features and patterns of each part that has any. `meshes` contains the meshes of all drawn parts, in order.

    number    of the drawn part; None if it is not drawn
    members   the feature itself, or the features of a pattern. The faces of a member consist of `runs` of consecutive triangles
              of the mesh (first triangle, and one after the last), clipped by all `boxes` (lower and upper corner [mm])
    """
    numbers = {part: number for number, part in enumerate(meshes)}
    return [
        {
            "part": str(part.name),
            "number": numbers.get(part),
            "features": [_entry(declared, meshes) for declared in part.toleranced],
        }
        for part in assembly.parts
        if part.toleranced
    ]


def _entry(declared: Feature | Pattern, meshes: Meshes) -> Scene:
    return {
        "noun": declared.noun,
        "name": str(declared.name),
        "datum": None if declared.datum is None else str(declared.datum),
        # only its kind if a fault prevents printing
        "tolerances": [one.kind if any(one.faults()) else str(one) for one in declared.tolerances],
        "members": [
            {"name": str(member.name), "faces": list(_faces(member, declared.part, meshes))} for member in declared.members
        ],
    }


def _faces(member: Feature, part: Part, meshes: Meshes) -> Iterator[Scene]:
    """Yield the faces of a member that have triangles on its part."""
    for face in member.faces:
        if face.part is part and not any(face.faults()) and all(mentioned in meshes for mentioned in face.parts):
            try:
                indices = triangles(face, meshes)
            except GeometryFault:  # a fault of the model, which the page lists
                continue
            ends = np.flatnonzero(np.diff(indices) != 1)
            first, last = indices[np.r_[0, ends + 1]], indices[np.r_[ends, len(indices) - 1]]
            runs = np.column_stack([first, last + 1]).ravel().tolist()
            boxes = [selection for selection in face.selections if isinstance(selection, Inside)]
            yield {"runs": runs, "boxes": [[[float(x) for x in end] for end in (box.lower, box.upper)] for box in boxes]}
