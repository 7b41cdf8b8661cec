"""Datasets as JSON on standard output."""

import json
from typing import TYPE_CHECKING

import numpy as np
import typer

if TYPE_CHECKING:
    import xarray as xr


def print_data(dataset: "xr.Dataset") -> None:
    """Print a dataset as JSON, which has no NaN or infinity: they are null, and the texts "Infinity" and "-Infinity"."""
    data = dataset.reset_coords()
    numbers = {name: values.copy(data=_as_json(values.values)) for name, values in data.items() if values.dtype.kind == "f"}
    typer.echo(json.dumps(data.assign(numbers).to_dict(), allow_nan=False, default=_plain))


def _as_json(values: np.ndarray) -> np.ndarray:
    objects = values.astype(object)
    for word, places in ((None, np.isnan(values)), ("Infinity", values == np.inf), ("-Infinity", values == -np.inf)):
        objects[places] = word
    return objects


def _plain(value: object) -> object:
    """Return a NumPy number as a JSON value."""
    return value.item() if isinstance(value, np.generic) else str(value)
