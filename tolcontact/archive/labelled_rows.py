"""Realizations with the labels of an archive, in memory."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive.variables import attributes_of, labels_of_rows
from tolcontact.compilation import Program
from tolcontact.vocabulary import ArchiveVariable


def labelled(program: Program, values: Mapping[ArchiveVariable, Any], attributes: Mapping[str, Any]) -> xr.Dataset:
    """Return arrays of any kind as variables of realizations, with the labels and attributes of an archive."""
    texts = {**labels_of_rows(program.nominal), terms.CONTRIBUTOR: program.nominal.contributors}
    labels: dict[str, Any] = {name: np.array(list(names), dtype=object) for name, names in texts.items()}  # text of any length
    labels[terms.REALIZATION] = pd.RangeIndex(len(values[terms.STATUS]))
    return xr.Dataset(
        {variable.name: (variable.dims, array, attributes_of(variable, program)) for variable, array in values.items()},
        {label.name: label.entry(labels[label.name]) for label in (*terms.COORDINATES, terms.CONTRIBUTOR_LABEL)},
        attributes,
    )
