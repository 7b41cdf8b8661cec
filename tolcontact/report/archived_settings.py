"""The settings of a run, for pages and spreadsheets."""

from typing import Any

import xarray as xr

SETTINGS = (
    "solver", "resolution", "objective", "regularization", "eta", "active_set", "search", "method_from", "sampler", "seed",
    "samples", "kept", "fields", "versions", "history", "format",
)  # fmt: skip


def archived_settings(results: xr.DataTree) -> dict[str, Any]:
    """Return the settings that an archive states, by the names of its attributes."""
    return {name: results.attrs[name] for name in SETTINGS}
