"""Run into an archive where no file may be larger than a megabyte: run_on_a_full_disk.py ARCHIVE. Exit code 7: it was told."""

import resource
import sys

import tolcontact as tc
from tests import cases
from tests.helpers import compiled

resource.setrlimit(resource.RLIMIT_FSIZE, (1_000_000, 1_000_000))
try:
    tc.run(compiled(cases.one_dimensional(2)), samples=12_000, seed=3, out=sys.argv[1])
except tc.errors.ArchiveError as error:
    assert "cannot be written" in str(error), error
    sys.exit(7)
