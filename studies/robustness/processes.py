"""Kill workers, writers and schedulers of runs, and let two runs write one archive: nothing may be lost, or be wrong.

python -m studies.robustness.processes --killed 30 --writers 50 --seed 0
"""

import argparse
import multiprocessing
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import psutil
import xarray as xr

import tolcontact as tc
from studies.robustness.attempts import Table, write_table
from tests.helpers import layout
from tolcontact.archive import check_rows

ROOT = Path(__file__).resolve().parents[2]
MODEL = str(ROOT / "models/ra1.py")
SAMPLES, STATION_SAMPLES = 60_000, 12_000
VARYING = ("summed_rows", "sums")


def begin(folder: Path, *options: str) -> subprocess.Popen:
    """Begin a run into run.nc."""
    return subprocess.Popen(
        [sys.executable, "-m", "tolcontact", "run", MODEL, "--samples", str(SAMPLES), "--out", "run.nc", "--quiet", *options],
        cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, stdin=subprocess.DEVNULL, text=True,
    )  # fmt: skip


def is_whole(path: Path, expected: Path) -> str:
    """Return what is wrong with an archive that should equal another one; empty if it does."""
    with tc.open_archive(path) as one, tc.open_archive(expected) as other:
        check_rows(one)
        for group in other.groups:
            if group not in one.groups:
                return f"has no group {group}"
            for name in other[group].data_vars:
                found, wanted = one[group][str(name)], other[group][str(name)]
                if name not in VARYING and not xr.DataArray(found.values).identical(xr.DataArray(wanted.values)):
                    return f"{group} {name} differs"
    return ""


def killed(count: int, rng: random.Random, folder: Path, expected: Path, table: Table) -> None:
    """Kill a worker, the writer, or the scheduler that a run uses; then resume it if it ended."""
    for number in range(count):
        victim = rng.choice(("worker", "writer", "scheduler"))
        for left in folder.glob("*run.nc*"):
            left.unlink()
        cluster: list[subprocess.Popen] = [] if victim != "scheduler" else _cluster()
        options = ["--scheduler", "tcp://127.0.0.1:8799"] if cluster else ["--workers", "2"]
        process = begin(folder, *options)
        time.sleep(rng.uniform(1.0, 9.0))
        words = ""
        if victim == "worker":
            own = psutil.Process(process.pid) if process.poll() is None else None
            children = (
                [child for child in own.children(recursive=True) if "spawn_main" in " ".join(child.cmdline())] if own else []
            )
            for child in rng.sample(children, min(1, len(children))):
                child.kill()
        elif victim == "writer":
            process.kill()
        else:
            os.kill(cluster[0].pid, signal.SIGKILL)
            cluster[0].wait()
            if rng.random() < 0.5:
                cluster[0] = _scheduler()
        try:
            _, words = process.communicate(timeout=240)
            fault = "" if process.returncode in (0, 2, -9) and "Traceback" not in words else f"code {process.returncode}"
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            fault = "did not end"
        for each in cluster:
            each.kill()
            each.wait()
        path = folder / "run.nc"
        how = "ended as if nothing were" if process.returncode == 0 else "had to be resumed"
        if not fault and process.returncode:
            again = begin(folder, "--resume")
            _, more = again.communicate(timeout=240)
            fault = "" if again.returncode == 0 else f"not resumed: {more}"
        fault = fault or is_whole(path, expected)
        table.add(f"killed: {victim}", fault or how, f"{number}: {words[-800:]}", is_fault=bool(fault))


def _cluster() -> list[subprocess.Popen]:
    """Begin a scheduler and two workers of it."""
    code = "from distributed.cli.dask_worker import main; main()"
    options = ["tcp://127.0.0.1:8799", "--nthreads", "1", "--no-dashboard", "--death-timeout", "60"]
    begun = [_scheduler()]
    time.sleep(2)
    return begun + [_quiet(code, *options) for _ in range(2)]


def _scheduler() -> subprocess.Popen:
    code = "from distributed.cli.dask_scheduler import main; main()"
    options = ["--host", "127.0.0.1", "--port", "8799", "--no-dashboard"]
    return _quiet(code, *options)


def _quiet(code: str, *options: str) -> subprocess.Popen:
    return subprocess.Popen([sys.executable, "-c", code, *options], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)


def writers(count: int, rng: random.Random, folder: Path, expected: Path, table: Table) -> None:
    """Begin two runs into one archive at about the same time."""
    for number in range(count):
        for left in folder.glob("*run.nc*"):
            left.unlink()
        first = begin(folder)
        time.sleep(rng.choice((0.0, 0.01, rng.uniform(0, 3))))
        second = begin(folder)
        words = [process.communicate(timeout=240)[1] for process in (first, second)]
        codes = {process.returncode for process in (first, second)}
        fault = "" if codes == {0, 2} else f"codes {codes}"
        fault = fault or is_whole(folder / "run.nc", expected)
        remains = sorted({path.name for path in folder.iterdir()} - {"run.nc", "whole.nc"})
        fault = fault or (f"left {', '.join(remains)}" if remains else "")
        table.add("two writers", fault or "one wrote, one was refused", f"{number}: {words}", is_fault=bool(fault))


def stations(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Kill runs of a model with stations at random moments, resume them, and compare with an undisturbed run, attributes too.

    The processes are forks that have the compiled model, so that most of their time is that of the run itself.
    """
    program, path, expected = tc.build(ROOT / "models/rail.py", solver="daqp"), folder / "run.nc", folder / "whole rail.nc"
    for path_of_whole in (folder / "first.nc", expected):  # what the first run compiles, the others find
        begun = time.monotonic()
        _forked(program, path_of_whole).join()
        seconds = time.monotonic() - begun
    for number in range(count):
        for left in folder.glob("*run.nc*"):
            left.unlink()
        process = _forked(program, path)
        process.join(rng.uniform(0.02, 1.0) * seconds)
        process.kill()
        process.join()
        how = "resumed" if (folder / ".run.nc.rows").exists() else "had ended" if path.exists() else "begun anew"
        process = _forked(program, path, resume=True)
        process.join(600)
        fault = "" if process.exitcode == 0 else f"not resumed: {process.exitcode}"
        fault = fault or is_whole(path, expected) or ("" if layout(path) == layout(expected) else "other attributes")
        table.add("killed stations", fault or how, str(number), is_fault=bool(fault))


def _forked(program: tc.Program, out: Path, **options: Any) -> Any:
    process = multiprocessing.get_context("fork").Process(
        target=lambda: tc.run(program, samples=STATION_SAMPLES, out=out, **options).close()
    )
    process.start()
    return process


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--killed", type=int, default=30)
    parser.add_argument("--writers", type=int, default=50)
    parser.add_argument("--stations", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    options, table = parser.parse_args(), Table()
    rng = random.Random(options.seed)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        whole = folder / "whole.nc"
        if options.writers or options.killed:
            tc.run(MODEL, samples=SAMPLES, out=whole).close()
        writers(options.writers, rng, folder, whole, table)
        killed(options.killed, rng, folder, whole, table)
        if options.stations:
            stations(options.stations, rng, folder, table)
    write_table("processes", table)


if __name__ == "__main__":
    main()
