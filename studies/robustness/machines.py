"""Run commands on full and read-only disks, and in environments that lack something.

    python -m studies.robustness.machines

Full disks are small file systems in memory: that needs the right to mount them.
"""

import argparse
import os
import resource
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

from studies.robustness.attempts import WORD, Table

ROOT = Path(__file__).resolve().parents[2]
MODEL = str(ROOT / "models/ra1.py")
WRITERS = {
    "new": ["new", "bracket"],
    "run --out": ["run", MODEL, "--samples", "5000", "--out", "run.nc", "--quiet"],
    "run --resume": ["run", MODEL, "--samples", "9000", "--out", "old.nc", "--resume", "--quiet"],
    "run --report": ["run", MODEL, "--samples", "100", "--report", "run.html", "--quiet"],
    "report": ["report", "old.nc", "--out", "old.html"],
    "view": ["view", MODEL, "--out", "view.html"],
    "compare --out": ["compare", MODEL, "--samples", "100", "--out", "both.nc"],
    "compare --report": ["compare", "old.nc", "other.nc", "--report", "both.html"],
    "contributions --into": ["contributions", MODEL, "--samples", "100", "--into", "old.nc", "--quiet"],
    "summary > file": ["summary", "old.nc"],
}
KEPT = ("old.nc", "other.nc")
SIZES = ("4k", "200k", "1200k", "2500k")
ENVIRONMENTS: Mapping[str, Mapping[str, str | None]] = {
    "usual": {},
    "no HOME": {"HOME": None},
    "HOME does not exist": {"HOME": "/nowhere"},
    "no HOME, no cache": {"HOME": "/dev/null", "XDG_CACHE_HOME": "/dev/null/x"},
    "LC_ALL=C": {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    "python -O": {"PYTHONOPTIMIZE": "1"},
    "python -OO": {"PYTHONOPTIMIZE": "2"},
    "-W error": {"PYTHONWARNINGS": "error"},
    "no color, no terminal": {"NO_COLOR": "1", "TERM": "dumb"},
    "narrow": {"COLUMNS": "20"},
    "one processor": {},
    "no /dev/shm": {},
    "200 MB of address space": {},
    "1 GB of address space": {},
    "64 open files": {},
    "umask 0": {},
    "umask 077": {},
    "stdout closed": {},
    "TMPDIR is missing": {"TMPDIR": "/nowhere"},
    "read-only home": {},
}


@contextmanager
def disk(size: str) -> Iterator[Path]:
    """Yield a folder on a small disk of its own."""
    with tempfile.TemporaryDirectory() as name:
        subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", name], check=True)
        try:
            yield Path(name)
        finally:
            subprocess.run(["umount", "-l", name], check=True)


def command(
    words: list[str], folder: Path, environment: Mapping[str, str], prepare: Callable[[], object] = lambda: None
) -> tuple[int, str, str]:
    """Return exit code, output and errors of a command in a process of its own."""
    with (folder.parent / "said.txt").open("w+") if words[0] != "summary" else (folder / "said.txt").open("w+") as said:
        done = subprocess.run(
            [sys.executable, "-m", "tolcontact", *words], cwd=folder, env=environment, stdin=subprocess.DEVNULL, text=True,
            stdout=said, stderr=subprocess.PIPE, errors="replace", timeout=600, check=False, preexec_fn=prepare,
        )  # fmt: skip
        said.seek(0)
        return done.returncode, said.read(), done.stderr


def judged(code: int, error: str) -> str:
    if code < 0:
        return f"signal {-code}"
    if WORD.search(error):
        return "traceback"
    if code == 2 and not error.startswith(("error:", "Usage", "╭")) and "error:" not in error:
        return "no message"
    return "done" if code in (0, 1) else "refused"


def disks(table: Table, old: Path) -> None:
    """Run every command that writes on full and read-only disks."""
    for name, words in WRITERS.items():
        for size in (*SIZES, "read-only"):
            with disk("64m" if size == "read-only" else size) as folder:
                for kept in KEPT:
                    if size in ("4k", "200k") and "old.nc" not in words:
                        continue
                    try:
                        shutil.copy(old, folder / kept)
                    except OSError:
                        (folder / kept).unlink(missing_ok=True)
                before = {path.name: path.read_bytes() for path in folder.iterdir()}
                if size == "read-only":
                    subprocess.run(["mount", "-o", "remount,ro", str(folder)], check=True)
                    if words[0] == "summary":
                        continue
                code, _, error = command(words, folder, dict(os.environ))
                ending = judged(code, error)
                after = {path.name: path.read_bytes() for path in folder.iterdir() if path.name != "said.txt"}
                left = set(after) - set(before)
                if ending == "refused" and left - {"run.nc"}:
                    ending = f"left {', '.join(sorted(left))}"
                if any(after.get(kept) != before.get(kept) for kept in KEPT) and ending == "refused":
                    ending = "changed what was there"
                wrong = ending not in ("done", "refused")
                table.add(f"disk of {size}" if size != "read-only" else size, ending, f"{name}: {error[-600:]}", is_fault=wrong)


def environments(table: Table, old: Path, first: int) -> None:
    """Run a model, and read its archive, in environments that lack something."""
    for name, changes in list(ENVIRONMENTS.items())[:first]:
        with tempfile.TemporaryDirectory() as temporary:
            folder = Path(temporary)
            shutil.copy(old, folder / "old.nc")
            environment = {key: value for key, value in {**os.environ, **changes}.items() if value is not None}
            prepare: Callable[[], object] = {
                "200 MB of address space": lambda: resource.setrlimit(resource.RLIMIT_AS, (200_000_000,) * 2),
                "1 GB of address space": lambda: resource.setrlimit(resource.RLIMIT_AS, (10**9,) * 2),
                "64 open files": lambda: resource.setrlimit(resource.RLIMIT_NOFILE, (64, 64)),
                "one processor": lambda: os.sched_setaffinity(0, {0}),
                "umask 0": lambda: os.umask(0),
                "umask 077": lambda: os.umask(0o077),
                "stdout closed": lambda: os.close(1),
            }.get(name, lambda: None)
            with without(name, folder) as more:
                for words in (
                    ["run", MODEL, "--samples", "100", "--out", "run.nc"],
                    ["summary", "old.nc"],
                    ["report", "old.nc", "--out", "page.html"],
                    ["run", MODEL, "--samples", "100", "--workers", "1"],
                ):
                    code, _, error = command(words, folder, {**environment, **more}, prepare)
                    ending = judged(code, error)
                    what = f"{' '.join(words).replace(MODEL, 'ra1.py')}: {error[-900:]}"
                    table.add(name, ending, what, is_fault=ending not in ("done", "refused"))


@contextmanager
def without(name: str, folder: Path) -> Iterator[Mapping[str, str]]:
    """Take away what an environment lacks; yield more variables of it."""
    if name == "no /dev/shm":
        subprocess.run(["mount", "-t", "tmpfs", "-o", "ro,size=4k", "tmpfs", "/dev/shm"], check=True)
        try:
            yield {}
        finally:
            subprocess.run(["umount", "-l", "/dev/shm"], check=True)
    elif name == "read-only home":
        with disk("64k") as home:
            subprocess.run(["mount", "-o", "remount,ro", str(home)], check=True)
            yield {"HOME": str(home), "XDG_CACHE_HOME": str(home / ".cache")}
    else:
        yield {}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--only", choices=["disks", "environments"])
    parser.add_argument("--first", type=int, default=len(ENVIRONMENTS), help="number of environments")
    options, table = parser.parse_args(), Table()
    with tempfile.TemporaryDirectory() as folder:
        old = Path(folder) / "old.nc"
        subprocess.run(
            [sys.executable, "-m", "tolcontact", "run", MODEL, "--samples", "500", "--out", str(old), "--quiet"],
            check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        if options.only != "environments":
            disks(table, old)
        if options.only != "disks":
            environments(table, old, options.first)
    print("\n".join(table.lines()))


if __name__ == "__main__":
    main()
