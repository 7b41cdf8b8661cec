"""Annotations of an assembly in its nominal frame [mm]: locators, contact points, measures, features and forces."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.declaration import Point
from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.errors import ArchiveError
from tolcontact.geometry.shapes import reflected
from tolcontact.realizations import declaration_of

Mark = dict[str, Any]


@dataclass(frozen=True)
class Marks:
    """Annotations by kind, each with a name.

    locators   at (3,), along (3,)
    contacts   part (its index), points (point, 3), gaps (point,), None if they come from an archive
    measures   points (point, 3), along (3,), or None, lines (line, 2, 3) between points, and at (3,), the position of the name
    features   at (3,), the centre of the face
    forces     at (3,), or None at the end of an axis, along (3,)
    """

    locators: list[Mark]
    contacts: list[Mark]
    measures: list[Mark]
    features: list[Mark]
    forces: list[Mark]


def marks_of(results: xr.DataTree) -> Marks:
    """Return the annotations that an archive has."""
    document = declaration_of(results)
    sample, contact = results["sample"].to_dataset(), results["contact"].to_dataset()
    points, directions = sample[terms.LOCATOR_POINT.name].values, sample[terms.LOCATOR_DIRECTION.name].values
    features = []
    if terms.FACE_CENTRE.name in contact:
        features = _named(contact[terms.FEATURE_OF_FACE.name].values, at=contact[terms.FACE_CENTRE.name].values)
    try:
        forces = [
            {"name": force["name"], "at": _at(document, force["at"]), "along": force["vector"]} for force in document["forces"]
        ]
        measures = list(_measures(document, results["model"].to_dataset()))
    except (LookupError, TypeError, ValueError, RuntimeError) as error:  # no run wrote it: its checksum was forged
        raise ArchiveError(f"the declared model in the archive is damaged: {type(error).__name__}: {error}") from error
    contacts: list[Mark] = []
    if terms.MOVING_POINT.name in contact:
        places, pairs = contact[terms.MOVING_POINT.name].values, contact[terms.PAIR_OF_POINT.name].values
        names = zip(results.to_dataset()[terms.PAIR].values, contact[terms.MOVING_PART.name].values.tolist(), strict=True)
        contacts = [
            {"name": str(name), "part": moving, "points": places[pairs == k], "gaps": None}
            for k, (name, moving) in enumerate(names)
        ]
    locators = _named(sample[terms.LOCATOR].values, at=points, along=directions)
    return Marks(locators, contacts, measures, features, forces)


def marks_of_nominal(nominal: Nominal) -> Marks:
    """Return the annotations of a model before a run."""
    contacts = []
    for pair in nominal.pairs:
        points, gaps = fixed_points(pair)
        contacts.append({"name": pair.name, "part": pair.moving, "points": points, "gaps": gaps})
    return Marks(
        _named(nominal.locators.labels, at=nominal.locators.points, along=nominal.locators.directions),
        contacts,
        [
            _measure(measure.name, measure.along, [_position(nominal, point) for point in measure.points], lines)
            for measure, lines in zip(nominal.measures, nominal.lines, strict=True)
            if measure.points or len(lines)
        ],
        _named([face.name for face in nominal.faces], at=[face.centre for face in nominal.faces]),
        [
            {"name": force.name, "at": _position(nominal, force.at), "along": list(force.vector)}
            for force in nominal.assembly.forces
        ],
    )


def _named(names: Iterable[str], **arrays: Iterable[np.ndarray]) -> list[Mark]:
    rows = zip(names, *arrays.values(), strict=True)
    return [{"name": str(name), **{key: x.tolist() for key, x in zip(arrays, row, strict=True)}} for name, *row in rows]


def fixed_points(pair: ContactPoints) -> tuple[np.ndarray, np.ndarray]:
    """Return contact points (point, 3) and gaps (point,) [mm], except on nearest tangents of hollow walls, which move."""
    return pair.P_m[pair.stays], pair.nominal_gaps(pose.AT_REST[None])[0, pair.stays]


def _measures(document: Mark, model: xr.Dataset) -> Iterator[Mark]:
    lines, measure_of_line = np.zeros((0, 2, 3)), np.zeros(0, dtype=int)
    if terms.LINE_ENDS.name in model:
        lines, measure_of_line = model[terms.LINE_ENDS.name].values, model[terms.MEASURE_OF_LINE.name].values
    for number, measure in enumerate(document["measures"]):
        declared = [measure[word] for word in ("of", "to") if "part" in (measure.get(word) or {})]
        positions = [end for end in (_at(document, point) for point in declared) if end is not None]
        measure_lines = lines[measure_of_line == number]
        if positions or len(measure_lines):
            yield _measure(measure["name"], measure["along"], positions, measure_lines)


def _measure(name: str, along: Any, positions: list[list[float]], lines: np.ndarray) -> Mark:
    """Return the mark of a measure of points, or of a measurement shown by lines."""
    if not positions:
        ends = dict.fromkeys(tuple(map(float, end)) for line in lines for end in line)
        at = [float(x) for x in lines[-1].mean(axis=0)]
        return {"name": name, "points": [list(end) for end in ends], "along": None, "lines": lines.tolist(), "at": at}
    pair = [positions] if len(positions) == 2 else []
    return {"name": name, "points": positions, "along": along, "lines": pair, "at": positions[0]}


def _at(document: Mark, point: Mark) -> list[float] | None:
    """Return the nominal position of a declared point; None for the end of an axis, which the document does not have."""
    if "position" not in point:
        return None
    part = next(entry for entry in document["parts"] if entry["name"] == point["part"])
    R = reflected(Rotation.from_rotvec(part["rotation"]).as_matrix(), part.get("mirror", ""))
    return [float(x) for x in R @ point["position"] + part["at"]]


def _position(nominal: Nominal, point: Point) -> list[float]:
    return [float(x) for x in nominal.position(point)]
