"""Set-up of the bolted cover in new processes: without anything in the cache but compiled kernels, and from the cache.

    python -m studies.elastic.set_up [points]

It builds the model once, and prints a JSON record of processor times [s] and memory [MB].
"""

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import platformdirs

import tolcontact as tc
from studies.elastic.scenes import bolted_cover
from studies.tables import Table
from tolcontact.errors import NominalWarning


def peak() -> float:
    """Return the largest memory [MB] of this process, which its resource usage would mix with that of its parent (Linux)."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024


def build(points: int) -> dict[str, float]:
    """Return the processor times [s] of imports, set-up and child processes, the time on the clock [s], and memory [MB]."""
    warnings.simplefilter("ignore", NominalWarning)
    build_program = tc.build  # imports what it needs
    imports, before, clock = time.process_time(), peak(), time.perf_counter()
    build_program(bolted_cover(points))
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return {
        "imports": imports,
        "build": time.process_time() - imports,
        "children": children.ru_utime + children.ru_stime,
        "clock": time.perf_counter() - clock,
        "before": before,
        "peak": peak(),
    }


def set_up(points: int) -> Table:
    """Return the cost of set-up, in a new cache folder with the kernels that Numba has compiled, and then again."""
    table = [["cache", "imports s", "set-up s", "its child processes s", "on the clock s", "memory MB, of it imports"]]
    kernels = platformdirs.user_cache_path("tolcontact", appauthor=False) / "numba"
    with tempfile.TemporaryDirectory() as folder:
        cache = Path(folder) / "tolcontact"
        cache.mkdir(mode=0o700)
        shutil.copytree(kernels, cache / "numba")
        command = [sys.executable, "-m", "studies.elastic.set_up", str(points)]
        for name in ("empty", "second process", "third process"):
            output = subprocess.run(command, env=os.environ | {"XDG_CACHE_HOME": folder}, capture_output=True, check=True)
            record = json.loads(output.stdout)
            times = [f"{record[key]:.1f}" for key in ("imports", "build", "children", "clock")]
            table.append([name, *times, f"{record['peak']:.0f}, {record['before']:.0f}"])
    return table


if __name__ == "__main__":
    print(json.dumps(build(int(sys.argv[1]))))
