"""What commands print."""

import json

import numpy as np
import pytest
import xarray as xr

from tolcontact.cli.output import print_data


def test_json_has_null_and_texts_for_what_is_not_finite(capsys):
    print_data(xr.Dataset({"bound": ("end", [np.nan, -np.inf])}, {"end": [np.inf, 1.0]}, {"range": np.inf}))
    said = json.loads(capsys.readouterr().out, parse_constant=pytest.fail)
    found = said["data_vars"]["bound"]["data"], said["coords"]["end"]["data"], said["attrs"]
    assert found == ([None, "-Infinity"], ["Infinity", 1.0], {"range": "Infinity"})
