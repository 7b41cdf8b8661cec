"""Realizations as a labelled dataset, as an archive has them, but in memory or yet to come."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive.header import labels_of_rows, units_of_rows
from tolcontact.compilation import Program
from tolcontact.vocabulary import ArchiveVariable


def labelled(program: Program, values: Mapping[ArchiveVariable, Any], attributes: Mapping[str, Any]) -> xr.Dataset:
    """Variables of realizations from arrays of any kind, with the labels and attributes that an archive gives them."""
    texts = {**labels_of_rows(program.nominal), terms.CONTRIBUTOR: program.nominal.contributors}
    labels: dict[str, Any] = {name: np.array(list(own), dtype=object) for name, own in texts.items()}  # text of any length
    labels[terms.REALIZATION] = pd.RangeIndex(len(values[terms.STATUS]))
    return xr.Dataset(
        {of.name: (of.dims, array, _attributes(of, program)) for of, array in values.items()},
        {of.name: (of.dims, labels[of.name], of.all_attributes) for of in (*terms.COORDINATES, terms.CONTRIBUTOR_LABEL)},
        attributes,
    )


def _attributes(variable: ArchiveVariable, program: Program) -> dict[str, Any]:
    attributes = variable.all_attributes
    if "flag_values" in attributes:
        attributes["flag_values"] = np.array(attributes["flag_values"], dtype=variable.kind)
    units = units_of_rows(program)
    return attributes | ({"units": units[variable]} if variable in units else {})
