"""A signal ends a command, also if a library makes another exception of it; a second one if a library ignores the first."""

import signal
import sys

import pytest

from tests.helpers import posix_only, run

BEGIN = """
import os, signal, sys, time
from tolcontact import interrupts
def stop(number=signal.SIGINT):
    os.kill(os.getpid(), number)
    time.sleep(0)
class Cleaned:
    def __del__(self):
        stop()
try:
    with interrupts.stoppable():
"""
END = """
        print("went on")
except KeyboardInterrupt:
    interrupts.end("stopped")
"""
PLACES = {
    "anywhere": ("stop()", signal.SIGINT),
    "SIGTERM": ("stop(signal.SIGTERM)", signal.SIGTERM),
    "made another error": (
        "try: stop()\n        except BaseException as error: raise ImportError('x') from error", signal.SIGINT,
    ),
    "made an exit": ("try: stop()\n        except BaseException: sys.exit(0)", signal.SIGINT),
}  # fmt: skip


@posix_only
@pytest.mark.parametrize("place", PLACES)
def test_one_signal_is_enough(place):
    code, number = PLACES[place]
    done = run([sys.executable, "-c", f"{BEGIN}        {code}{END}"])
    assert (done.returncode, done.stdout, done.stderr) == (128 + number, "", "stopped\n")


@posix_only
@pytest.mark.parametrize(
    "code",
    [
        "Cleaned()\n        stop(); time.sleep(60)",
        "try: stop()\n        except BaseException: pass\n        stop(); time.sleep(60)",
    ],
    ids=["in a clean-up", "by a library"],
)
def test_a_second_one_ends_what_ignored_the_first(code):
    done = run([sys.executable, "-c", f"{BEGIN}        {code}{END}"])
    assert (done.returncode, done.stdout) == (130, "") and done.stderr.endswith("stopped\n")


@posix_only
def test_where_nothing_is_to_be_cleaned_up_one_ends_the_process():
    code = "try: stop()\n        finally: print('cleaned')"
    done = run([sys.executable, "-c", f"{BEGIN.replace('stoppable()', 'stoppable(at_once=True)')}        {code}{END}"])
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "stopped\n")


def test_without_a_signal_everything_is_as_before():
    code = "before = [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]\n"
    code += "from tolcontact import interrupts\nwith interrupts.stoppable(): pass\n"
    code += "assert before == [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]"
    assert run([sys.executable, "-c", f"import signal\n{code}"]).returncode == 0


@posix_only
def test_too_little_address_space_is_said_where_libraries_would_hang():
    code = "import resource, os, sys; resource.setrlimit(resource.RLIMIT_AS, (10**9,) * 2); "
    code += "os.execv(sys.executable, [sys.executable, '-m', 'tolcontact', '--version'])"
    done = run([sys.executable, "-c", code])
    assert done.returncode == 2 and "address space" in done.stderr and "Traceback" not in done.stderr


@posix_only
def test_closed_streams_do_no_harm_to_the_next_files(tmp_path):
    archive = tmp_path / "run.nc"
    command = f"{sys.executable} -m tolcontact run models/ra1.py --samples 20 --out {archive} 0<&- 1>&- 2>&-"
    assert run(["sh", "-c", command]).returncode == 0
    assert archive.read_bytes()[1:4] == b"HDF"
    assert run([sys.executable, "-m", "tolcontact", "summary", str(archive)]).returncode == 0
