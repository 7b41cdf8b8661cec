"""What the turning picture of a page is drawn from: bodies, fields, locators, contact points, and single realizations."""

import json
from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from tolcontact import vocabulary as words
from tolcontact.report.html.coarse import allowed, coarser
from tolcontact.report.html.packed import Packed, packed
from tolcontact.report.html.shown import Shown

Drawn = dict[str, Any]


def scene_of(results: xr.DataTree, shown: list[Shown]) -> Drawn:
    """Everything in the nominal assembly frame [mm]; what an archive does not have is left out."""
    document = json.loads(str(results["model"][words.DECLARATION.name].values))
    return {
        "parts": _parts(results),
        "locators": _locators(results),
        "contacts": list(_contacts(results)),
        "measures": list(_measures(document)),
        "forces": [
            {"name": each["name"], "at": _at(document, each["at"]), "along": each["vector"]} for each in document["forces"]
        ],
        "realizations": _realizations(results, shown),
    }


def _parts(results: xr.DataTree) -> list[Drawn]:
    names = [str(name) for name in results.to_dataset()[words.PART].values]
    fields = [results["field"].children[words.group_of(name)].to_dataset() for name in names]
    counts = allowed([field.sizes[words.FACE] for field in fields])
    return [_part(name, field, count) for name, field, count in zip(names, fields, counts, strict=True)]


def _part(name: str, field: xr.Dataset, count: int) -> Drawn:
    before = field[words.FIELD_FACES.name].values
    vertices, faces, nearest = coarser(field[words.FIELD_VERTICES.name].values, before, count)
    drawn: Drawn = {"name": name, "vertices": packed(vertices), "faces": packed(faces, "i4"), "triangles": len(before)}
    for word, variable in (("mean", words.FIELD_MEAN), ("sixSigma", words.FIELD_SIX_SIGMA)):
        values = field[variable.name].values[:, nearest]
        if np.isfinite(values[..., :3]).all():
            drawn[word] = packed(values)
    return drawn


def _locators(results: xr.DataTree) -> list[Drawn]:
    sample = results["sample"].to_dataset()
    if words.LOCATOR_POINT.name not in sample:
        return []
    points, directions = sample[words.LOCATOR_POINT.name].values, sample[words.LOCATOR_DIRECTION.name].values
    return [
        {"name": str(name), "at": at.tolist(), "along": along.tolist()}
        for name, at, along in zip(sample[words.LOCATOR].values, points, directions, strict=True)
    ]


def _contacts(results: xr.DataTree) -> Iterator[Drawn]:
    contact = results["contact"].to_dataset()
    if words.MOVING_POINT.name not in contact:
        return
    points, pair_of_point = contact[words.MOVING_POINT.name].values, contact[words.PAIR_OF_POINT.name].values
    for number, name in enumerate(results.to_dataset()[words.PAIR].values):
        moving = int(contact[words.MOVING_PART.name].values[number])
        yield {"name": str(name), "part": moving, "points": packed(points[pair_of_point == number])}


def _measures(document: Drawn) -> Iterator[Drawn]:
    for measure in document["measures"]:
        ends = [_at(document, measure[word]) for word in ("of", "to") if word in measure]
        known = [end for end in ends if end is not None]
        if known:
            yield {"name": measure["name"], "points": known, "along": measure["along"]}


def _at(document: Drawn, point: Drawn) -> list[float] | None:
    """Where a declared point is in the nominal assembly; None of an axis's end, which is the geometry's."""
    if "position" not in point:
        return None
    part = next(each for each in document["parts"] if each["name"] == point["part"])
    R = Rotation.from_rotvec(part["rotation"]).as_matrix()
    return [float(x) for x in R @ point["position"] + part["at"]]


def _realizations(results: xr.DataTree, shown: list[Shown]) -> Drawn:
    """Single realizations; their motions (realization, state, part, 12) as R - I and t."""
    order = np.argsort([each.row for each in shown], kind="stable")
    back = np.empty(len(order), dtype=int)
    back[order] = np.arange(len(order))
    rows = results.to_dataset().isel({words.REALIZATION: np.array([each.row for each in shown], dtype=int)[order]})
    drawn: Drawn = {
        "rows": [each.row for each in shown],
        "why": [each.why for each in shown],
        "status": [words.STATUS_MEANINGS[status] for status in rows[words.STATUS.name].values[back]],
        "residual": packed(rows[words.KKT_RESIDUAL.name].values[back]),
        "gaps": packed(rows[words.GAP_MIN.name].values[back]),
        "measured": packed(rows[words.MEASURED.name].values[back]),
    }
    if words.ROTATION.name in rows:
        R, t = rows[words.ROTATION.name].values[back] - np.eye(3), rows[words.TRANSLATION.name].values[back]
        drawn["motions"] = _motions(R, t)
    return drawn


def _motions(R: np.ndarray, t: np.ndarray) -> Packed:
    return packed(np.concatenate([R.reshape(*R.shape[:-2], 9), t], axis=-1))
