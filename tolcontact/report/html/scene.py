"""What the turning picture of a page is drawn from: bodies, fields, locators, contact points, and single realizations."""

from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.analysis_tables import archived_analysis
from tolcontact.report.annotations import Marks, marks_of
from tolcontact.report.html.decimation import allowed, coarser
from tolcontact.report.html.packed_array import Packed, packed
from tolcontact.report.html.shown_realizations import Shown
from tolcontact.statistics import touching

Drawn = dict[str, Any]


def scene_of(results: xr.DataTree, summary: xr.Dataset, shown: list[Shown]) -> Drawn:
    """Everything in the nominal assembly frame [mm]; what an archive does not have is left out."""
    drawn = {"parts": _parts(results), **drawn_marks(marks_of(results)), "realizations": _realizations(results, shown)}
    _add_contact(drawn["contacts"], results, summary)
    return {**drawn, "reactionUnits": summary["reaction"].attrs["units"]}


def _add_contact(pairs: list[Drawn], results: xr.DataTree, summary: xr.Dataset) -> None:
    """How often each contact point touches, and what its pair carries."""
    found = touching(results) if pairs else None
    for pair in pairs:
        if found is not None and found.attrs["realizations"]:
            own = found["pair"].values == pair["name"]
            pair["touching"] = packed(found["touching"].sel(interval="estimate").values[own])
        mean = float(summary["reaction"].sel(pair=pair["name"], of_reaction="mean", interval="estimate"))
        pair["reaction"] = mean if np.isfinite(mean) else None


def drawn_marks(marks: Marks) -> Drawn:
    """Locators, contact points, measures and forces, as a page holds them."""
    return {
        "locators": marks.locators,
        "contacts": [
            {word: packed(value) if isinstance(value, np.ndarray) else value for word, value in pair.items()}
            for pair in marks.contacts
        ],
        "measures": marks.measures,
        "features": marks.features,
        "forces": marks.forces,
    }


def _parts(results: xr.DataTree) -> list[Drawn]:
    names = [str(name) for name in results.to_dataset()[terms.PART].values]
    fields = [results["field"].children[terms.group_of(name)].to_dataset() for name in names]
    counts = allowed([field.sizes[terms.FACE] for field in fields])
    return [_part(name, field, count) for name, field, count in zip(names, fields, counts, strict=True)]


def _part(name: str, field: xr.Dataset, count: int) -> Drawn:
    before = field[terms.FIELD_FACES.name].values
    vertices, faces, nearest = coarser(field[terms.FIELD_VERTICES.name].values, before, count)
    drawn: Drawn = {"name": name, "vertices": packed(vertices), "faces": packed(faces, "i4"), "triangles": len(before)}
    for word, variable in (("mean", terms.FIELD_MEAN), ("sixSigma", terms.FIELD_SIX_SIGMA)):
        values = field[variable.name].values[:, nearest]
        if np.isfinite(values[..., :3]).all():
            drawn[word] = packed(values)
    return drawn


def _realizations(results: xr.DataTree, shown: list[Shown]) -> Drawn:
    """Worst cases that are kept, and single realizations; their motions (realization, state, part, 12) as R - I and t."""
    order = np.argsort([each.row for each in shown], kind="stable")
    back = np.empty(len(order), dtype=int)
    back[order] = np.arange(len(order))
    rows = results.to_dataset().isel({terms.REALIZATION: np.array([each.row for each in shown], dtype=int)[order]})
    worst = archived_analysis(results, terms.WORST_CASE)
    names = [] if worst is None else [f"worst case: {case}" for case in worst[terms.CASE].values]

    def of(variable: terms.ArchiveVariable) -> np.ndarray:
        own = rows[variable.name].values[back]
        return own if worst is None else np.concatenate([worst[variable.name].values, own])

    drawn: Drawn = {
        "names": names + [f"realization {each.row} ({each.why})" for each in shown],
        "status": [terms.STATUS_MEANINGS[status] for status in of(terms.STATUS)],
        "residual": packed(of(terms.KKT_RESIDUAL)),
        "gaps": packed(of(terms.GAP_MIN)),
        "measured": packed(of(terms.MEASURED)),
    }
    if terms.ROTATION.name in rows:
        drawn["motions"] = _motions(of(terms.ROTATION) - np.eye(3), of(terms.TRANSLATION))
    return drawn


def _motions(R: np.ndarray, t: np.ndarray) -> Packed:
    return packed(np.concatenate([R.reshape(*R.shape[:-2], 9), t], axis=-1))
