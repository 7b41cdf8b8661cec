"""Marks in the table of a measurement."""

import numpy as np
import xarray as xr

from tolcontact.limits import Limits
from tolcontact.report.summary_text import measure_table
from tolcontact.statistics.capability import as_normal, by_percentiles
from tolcontact.statistics.sample import Sample


def test_an_index_differs_from_its_counterpart_with_95_of_100_confidence_for_all_measurements():
    """No mark in 25 normal measurements, and one for a lognormal one among them."""
    rng, figures = np.random.default_rng(6), []
    for values in (*rng.standard_normal((25, 8000)), np.exp(0.4 * rng.standard_normal(8000))):
        x, limits = Sample.of(values), Limits(-np.inf, 4.5)
        figures.append([[by_percentiles(x, limits)[1]] * 2, [as_normal(x, limits)[1]] * 2])
    estimates, names = np.array(figures).transpose(0, 2, 1, 3), [f"x{k}" for k in range(len(figures))]
    dims = {"statistic": ["Ppk", "Ppk as normal"], "interval": ["estimate", "lower", "upper"]}
    nothing = {
        "measure_units": "mm",
        "measure_quantity": "",
        "measure_lower": np.nan,
        "measure_upper": 4.5,
        "measure_required": 0,
        "measure_few_rows": 0,
    }
    marked = [
        any("*" in cell for row in measure_table(xr.Dataset(
            {
                "statistic_value": (("state", "statistic", "interval"), of_measure),
                "change": (("change_of", "interval"), np.full((1, 3), np.nan)),
            },
            {"state": ["raw", "corrected"], "change_of": ["none"], "measure": name, **dims, **nothing},
        ), len(names)).rows for cell in row)
        for name, of_measure in zip(names, estimates, strict=True)
    ]  # fmt: skip
    assert marked == [False] * 25 + [True]
