"""Commands in forked processes: how each ended, what it said, and what it took."""

import os
import re
import signal
import subprocess
import sys
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from datetime import date
from pathlib import Path
from typing import NamedTuple

import tolcontact
import tolcontact.cli

WORD = re.compile(r"Traceback|Exception ignored|Segmentation|^[\w.]*Error:", re.MULTILINE)


class Ending(NamedTuple):
    """How a command ended; `code` is negative for a signal, None if it took too long. Seconds are those of the processor."""

    code: int | None
    out: str
    error: str
    seconds: float
    megabytes: float

    @property
    def fault(self) -> str:
        """What is wrong with it; empty if it did what it should, or refused with one message."""
        if self.code is None:
            return "did not end"
        if self.code < 0:
            return f"signal {-self.code}"
        if WORD.search(self.error):
            return "traceback"
        if self.code not in (0, 1, 2):
            return f"code {self.code}"
        return "no message" if self.code == 2 and "error" not in self.error.lower() else ""


def attempt(arguments: list[str], folder: Path, limit: float = 120.0, prepare: Callable[[], object] = lambda: None) -> Ending:
    """Run a command in a folder, `prepare`d in its own process, for at most `limit` seconds."""
    out, error = folder / ".out.txt", folder / ".error.txt"
    process = os.fork()
    if process == 0:
        with suppress(BaseException):
            os.setsid()
            for number, path in ((1, out), (2, error)):
                os.dup2(os.open(path, os.O_CREAT | os.O_TRUNC | os.O_WRONLY), number)
            os.chdir(folder)
            prepare()
            sys.stdout, sys.stderr = (os.fdopen(number, "w", encoding="utf-8") for number in (1, 2))
            code = 0
            try:
                tolcontact.cli.command_line(arguments)
            except SystemExit as ended:
                code = ended.code if isinstance(ended.code, int) else 0 if ended.code is None else 1
            except BaseException:
                sys.excepthook(*sys.exc_info())
                code = 70
            for stream in (sys.stdout, sys.stderr):
                with suppress(Exception):
                    stream.flush()
            os._exit(code)
        os._exit(71)
    end, status = time.monotonic() + limit, None
    while status is None:
        found, state, usage = os.wait4(process, os.WNOHANG)
        if found:
            status = os.waitstatus_to_exitcode(state)
        elif time.monotonic() > end:
            os.killpg(process, signal.SIGKILL)
            _, _, usage = os.wait4(process, 0)
            break
        else:
            time.sleep(0.01)
    said, reported = (path.read_text(errors="replace") for path in (out, error))
    return Ending(status, said, reported, usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 1024)


class Table:
    """Counts of tries by their endings; what is wrong is printed at once."""

    def __init__(self) -> None:
        self.counts: dict[str, Counter[str]] = {}

    def add(self, name: str, ending: str, words: str = "", *, is_fault: bool = False) -> None:
        """Count a try."""
        self.counts.setdefault(name, Counter())[ending] += 1
        if is_fault:
            print(f"!! {name}: {ending}: {words}", flush=True)

    def lines(self) -> Iterator[str]:
        """Yield the table."""
        endings = sorted({ending for counter in self.counts.values() for ending in counter})
        yield f"| | tries | {' | '.join(endings)} |"
        yield "|---" * (len(endings) + 2) + "|"
        for name, counter in self.counts.items():
            yield f"| {name} | {counter.total()} | {' | '.join(str(counter[ending]) for ending in endings)} |"


def write_table(name: str, table: Table) -> None:
    """Print a table; with TOLCONTACT_RECORD set, write it into the README between the markers of its name, too."""
    lines = "\n".join(table.lines())
    print(lines)
    if os.environ.get("TOLCONTACT_RECORD"):
        readme = Path(__file__).with_name("README.md")
        commit = subprocess.run(
            ["git", "describe", "--always"], cwd=readme.parent, capture_output=True, text=True, check=True
        ).stdout
        note = f"{tolcontact.__version__} ({commit.strip()}), {date.today()}: `{' '.join(sys.argv[1:])}`"
        begin, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
        head, _, rest = readme.read_text(encoding="utf-8").partition(begin)
        readme.write_text(f"{head}{begin}\n{note}\n\n{lines}\n{end}{rest.partition(end)[2]}", encoding="utf-8")


def contents(folder: Path) -> Mapping[str, bytes]:
    """Return the files of a folder, but those of `attempt`."""
    return {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file() and not path.name.startswith(".")}
