"""Read an archive again and again while its results are open: read_while_open.py ARCHIVE."""

import sys

import xarray as xr

import tolcontact as tc
from tests import cases

held = tc.run(cases.stack(), samples=20, out=sys.argv[1])
for _ in range(3):
    for group in (None, "contact", "sample"):
        xr.load_dataset(sys.argv[1], group=group)
assert list(held["part"].values) == ["bottom", "middle", "upper"]
