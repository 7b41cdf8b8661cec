"""Run the two elastic tips into an archive, and say after each block how many realizations are finished.

run_tips.py FOLDER ARCHIVE SAMPLES; their matrices are in the folder.
"""

import sys
from pathlib import Path

import tolcontact as tc
from tests.test_elastic_parts import tips

folder, archive, samples = sys.argv[1:]
tc.run(tips(Path(folder)), samples=int(samples), seed=3, out=archive, progress=lambda rows: print(rows, flush=True)).close()
