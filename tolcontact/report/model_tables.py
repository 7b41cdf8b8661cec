"""A declared model as its archive holds it: tables of parts, features, locators, pairs and measurements; settings."""

import math
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.declaration import Chain, Tolerance, Variable
from tolcontact.declaration.document import tolerance_of_entry, variable_of_entry
from tolcontact.errors import ArchiveError
from tolcontact.realizations import declaration_of
from tolcontact.report.table import Cell, Table, nominal_and_limits, plain

Entry = dict[str, Any]
SETTINGS = (
    "solver", "standard", "resolution", "objective", "regularization", "active_set", "search", "method_from", "sampler", "seed",
    "samples", "kept", "fields", "versions", "history", "format",
)  # fmt: skip


def model_tables(results: xr.DataTree) -> list[Table]:
    """Return the tables of the model that have rows. Raises ArchiveError for a damaged declaration."""
    document = declaration_of(results)
    makers: tuple[Callable[[Entry, xr.DataTree], Table], ...] = (
        _dimensions, _parts, _features, _locators, _pairs, _measurements,
    )  # fmt: skip
    try:
        tables = [make(document, results) for make in makers]
    except (LookupError, TypeError, ValueError) as error:
        raise ArchiveError(f"the declared model in the archive is damaged: {type(error).__name__}: {error}") from error
    return [table.without_empty_columns() for table in tables if table.rows]


def dimensions_of(document: Entry) -> list[Variable]:
    """Return the dimensions that chains are made of."""
    return [variable_of_entry(entry) for entry in document["variables"] if entry.get("nominal") is not None]


def chains_of(document: Entry) -> dict[str, Entry]:
    """Return the chains that are measured, by the names of their measures."""
    measurements = {measure["name"]: measure["of"] for measure in document["measures"] if isinstance(measure.get("of"), dict)}
    return {name: of for name, of in measurements.items() if of.get("kind") == Chain.kind}


def _dimensions(document: Entry, results: xr.DataTree) -> Table:
    chains = chains_of(document)
    rows = [
        [
            dimension.name, dimension.drawn, dimension.centred, dimension.units, _capability(dimension.tolerance),
            *(chain["sensitivities"].get(dimension.name) for chain in chains.values()),
        ]
        for dimension in dimensions_of(document)
    ]  # fmt: skip
    columns = ["dimension", "as drawn", "centred", "units", "distribution", *(f"sensitivity of {name}" for name in chains)]
    return Table("Dimensions", columns, rows)


def _capability(tolerance: Tolerance) -> str:
    name = tolerance.distribution if isinstance(tolerance.distribution, str) else str(tolerance.frozen.dist.name)
    numbers = [f"{key} {value:g}" for key, value in (("cp", tolerance.cp), ("cpk", tolerance.cpk)) if value is not None]
    return ", ".join([name, *numbers])


def _parts(document: Entry, results: xr.DataTree) -> Table:
    supports = {location["part"]: location["on"] or "the ground" for location in document["locations"]}
    rows = []
    for part in document["parts"]:
        geometry = part["geometry"]
        shape = f"box {_triple(geometry['box'])} mm" if "box" in geometry else str(next(iter(geometry.values())))
        support = "fixed" if part.get("fixed") else f"located on {supports.get(part['name'], 'nothing')}"
        rows.append([part["name"], shape, _triple(part["at"]), support])
    return Table("Parts", ["part", "shape", "position, mm", "held"], rows)


def _features(document: Entry, results: xr.DataTree) -> Table:
    rows, targets = [], []
    for part in document["parts"]:
        for feature in part.get("features", []):
            members = f" ({len(feature['members'])} members)" if "members" in feature else ""
            tolerances = "\n".join(str(tolerance_of_entry(entry)) for entry in feature["tolerances"])
            rows.append([part["name"], f"{feature['name']}{members}", feature.get("datum") or "", tolerances])
        for target in part.get("datum_targets", []):
            targets.append([part["name"], f"{len(target['targets'])} datum targets", target["datum"], ""])
    return Table("Features, datums and tolerances", ["part", "feature", "datum", "tolerances, mm"], rows + targets)


def _locators(document: Entry, results: xr.DataTree) -> Table:
    sample = results["sample"].to_dataset()
    labels = [str(label) for label in sample[terms.LOCATOR].values]
    numbers = {str(label): k for k, label in enumerate(sample[terms.CONTRIBUTOR].values)}
    rows: list[list[Cell]] = []
    contact, compliant = results["contact"].to_dataset(), set[int]()
    if terms.POINT_STIFFNESS.name in contact:
        gives = np.isfinite(contact[terms.POINT_STIFFNESS.name].values)
        compliant = set(contact[terms.LOCATOR_OF_POINT.name].values[gives].tolist())
    for k, label in enumerate(labels):
        part, _, name = label.rpartition(".")
        at, along = (sample[v.name].values[k] for v in (terms.LOCATOR_POINT, terms.LOCATOR_DIRECTION))
        width = float(sample[terms.TOLERANCE_RANGE.name].values[numbers[label]])
        distribution = str(sample[terms.DISTRIBUTION.name].values[numbers[label]])
        kind = "one-sided" if sample[terms.ONE_SIDED.name].values[k] else "two-sided"
        if k in compliant:
            kind += f", {float(sample[terms.STIFFNESS.name].values[k]):g} N/mm"
        rows.append([part, name, _triple(at), _triple(along), width if math.isfinite(width) else None, distribution, kind])
    columns = ["part", "locator", "point, mm", "direction", f"{terms.ZONE_WIDTH}, mm", "distribution", "held"]
    return Table("Locators", columns, rows)


def _pairs(document: Entry, results: xr.DataTree) -> Table:
    contact = results["contact"].to_dataset()
    counts = np.zeros(0, dtype=int)
    if terms.PAIR_OF_POINT.name in contact:
        counts = np.bincount(contact[terms.PAIR_OF_POINT.name].values, minlength=len(document["pairs"]))
    gives = any("stiffness" in pair for pair in document["pairs"])
    rows = []
    for k, pair in enumerate(document["pairs"]):
        points = float(counts[k]) if k < len(counts) else None
        stiffness = [pair.get("stiffness")] if gives else []
        rows.append([pair["name"], pair["moving"]["part"], pair["reference"]["part"], points, *stiffness])
    columns = ["contact pair", "moving part", "reference part", "contact points", *(["stiffness, N/mm"] if gives else [])]
    return Table("Contact pairs", columns, rows)


def _measurements(document: Entry, results: xr.DataTree) -> Table:
    root = results.to_dataset()
    rows: list[list[Cell]] = []
    for k, measure in enumerate(document["measures"]):
        lower, upper = (float(root[variable.name].values[k]) for variable in (terms.LOWER_LIMIT, terms.UPPER_LIMIT))
        along = "" if measure.get("along") is None else _triple(measure["along"])
        texts = nominal_and_limits(float(root[terms.MEASURE_NOMINAL.name].values[k]), lower, upper)
        rows.append(
            [
                measure["name"], _quantity(measure), _end(measure.get("to")), along, str(measure["units"]),
                *(float(text) if text else None for text in texts),
            ]
        )  # fmt: skip
    columns = [terms.MEASUREMENT, "of", "to", "along", "units", "nominal", "lower limit", "upper limit"]
    return Table("Measurements", columns, rows)


def _quantity(measure: Entry) -> str:
    if "of" not in measure:
        return "expression of the poses"
    if measure["of"].get("kind") == Chain.kind:
        return f"chain of {len(measure['of']['sensitivities'])} links"
    return f"{measure['of']['kind']} of {', '.join(_named(measure['of']))}" if "kind" in measure["of"] else _end(measure["of"])


def _named(entry: Any) -> list[str]:
    """Return the parts of the faces and points of a measurement, or the names of its measures, each once."""
    if isinstance(entry, str):
        return [entry]
    if "part" in entry:
        return [str(entry["part"])]
    operands = entry.get("measurements", [value for value in entry.values() if isinstance(value, dict)])
    return list(dict.fromkeys(name for operand in operands for name in _named(operand)))


def _end(point: Entry | None) -> str:
    if point is None:
        return ""
    return f"{point['part']} {_triple(point['position'])}" if "position" in point else f"{point['part']}, end of an axis"


def _triple(values: Sequence[float]) -> str:
    return f"({', '.join(plain(float(value), 1.0) for value in values)})"


def archived_settings(results: xr.DataTree) -> dict[str, Any]:
    """Return the settings that an archive states, by the names of its attributes."""
    return {name: results.attrs[name] for name in SETTINGS if name != terms.STANDARD or name in results.attrs}
