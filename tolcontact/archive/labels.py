"""Labels, sizes and units of the rows of an archive, and datasets that are labelled like an archive."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal
from tolcontact.vocabulary import ArchiveVariable


def labels_of_rows(nominal: Nominal) -> dict[str, Sequence[str]]:
    """Return the labels along the dimensions of rows."""
    return {
        terms.STATE: terms.STATES,
        terms.PART: [part.name for part in nominal.parts],
        terms.PAIR: [pair.name for pair in nominal.pairs],
        terms.MEASURE: [measure.name for measure in nominal.measures],
        terms.AXIS: terms.AXES,
        terms.BODY_AXIS: terms.AXES,
    }


def sizes_of_rows(nominal: Nominal) -> dict[str, int]:
    """Return the sizes of the dimensions of a row."""
    return {name: len(labels) for name, labels in labels_of_rows(nominal).items()} | {
        terms.CONTRIBUTOR: len(nominal.contributors)
    }


def units_of_rows(program: Program) -> dict[ArchiveVariable, str]:
    """Return the units that depend on the model; those of measures are "1" if they differ."""
    units = {measure.units for measure in program.nominal.measures} or {"mm"}
    return {
        terms.REACTION: program.method.minimizes.reaction_units,
        terms.MEASURED: units.pop() if len(units) == 1 else "1",
    }


def labelled(program: Program, values: Mapping[ArchiveVariable, Any], attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return arrays of any kind as variables of realizations, with the labels and attributes of an archive."""
    texts = {**labels_of_rows(program.nominal), terms.CONTRIBUTOR: program.nominal.contributors}
    labels: dict[str, Any] = {name: np.array(list(names), dtype=object) for name, names in texts.items()}  # text of any length
    labels[terms.REALIZATION] = pd.RangeIndex(len(values[terms.STATUS]))
    return xr.Dataset(
        {variable.name: (variable.dims, array, _attributes(variable, program)) for variable, array in values.items()},
        {label.name: label.entry(labels[label.name]) for label in (*terms.COORDINATES, terms.CONTRIBUTOR_LABEL)},
        attributes,
    )


def _attributes(variable: ArchiveVariable, program: Program) -> dict[str, Any]:
    attributes = variable.all_attributes
    if "flag_values" in attributes:
        attributes["flag_values"] = np.array(attributes["flag_values"], dtype=variable.kind)
    units = units_of_rows(program)
    return attributes | ({"units": units[variable]} if variable in units else {})
