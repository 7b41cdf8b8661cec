"""Write a small archive with stations, compressed, to be kept for good and read by all later versions."""

import gzip
import sys
import tempfile
from pathlib import Path

import tolcontact as tc
from tests.cases import stations

with tempfile.TemporaryDirectory() as folder:
    path = Path(folder) / "rail.nc"
    tc.run(stations.rail(), samples=8, seed=1, solver="daqp", surfaces=4, fields=16_384, out=path).close()
    Path(sys.argv[1]).write_bytes(gzip.compress(path.read_bytes(), mtime=0))
