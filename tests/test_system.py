"""Only the package `system` knows operating systems, and without what only POSIX has the commands do what they do with it."""

import ast
import os
import re
import sys
from collections.abc import Iterator
from types import MappingProxyType

import pytest

from tests.helpers import COMMAND, ROOT, SCRIPTS, nightly, run
from tests.step_files import step_block

PACKAGE = ROOT / "tolcontact"
FILES = [file for file in sorted(PACKAGE.rglob("*.py")) if file.relative_to(PACKAGE).parts[0] != "system"]

MODULES = re.compile(
    r"(resource|grp|pwd|spwd|fcntl|termios|pty|tty|posix|syslog|readline|curses|msvcrt|winreg|_winapi|_posix\w+)"
    r"|multiprocessing\.resource_tracker"
)
# Of `os`: what Windows lacks, or has in another sense, and the name of the system.
ATTRIBUTES = re.compile(
    r"os\.(name|uname|O_(?!(RDONLY|WRONLY|RDWR|CREAT|EXCL|TRUNC|APPEND)$)\w+|(get|set)(e|re|res)?[ug]id|(get|set)(sid|pgid|pgrp)|"
    r"getgroups|initgroups|getpriority|setpriority|nice|getloadavg|sysconf\w*|confstr\w*|sched_\w+|fork\w*|kill(pg)?|wait(?!pid)\w*|"
    r"W[A-Z]\w+|posix_\w+|mkfifo|mknod|[fl]?chown|[fl]chmod|chroot|statvfs|fstatvfs|p?(read|write)v|umask|supports_\w+|ctermid)"
    r"|sys\.(platform|getwindowsversion)|platform\.(system|win32_ver|mac_ver|uname)"
)
SIGNALS = re.compile(  # of `signal`: what Windows has as well
    r"signal\.(SIG(INT|TERM|ABRT|FPE|ILL|SEGV|_DFL|_IGN)|signal|[gs]etsignal|raise_signal|strsignal|Signals|Handlers|default_int_handler)"
)
PATHS = re.compile(r"/(proc|dev|sys|tmp|etc|usr|var|bin)(/|$)")
ARGUMENTS = ("preexec_fn", "start_new_session", "process_group", "pass_fds", "dir_fd", "src_dir_fd", "dst_dir_fd", "umask")


def is_posix(name: str) -> bool:
    """Whether a dotted name is of a part of Python that not all systems have."""
    is_signal = name.startswith("signal.") and not SIGNALS.fullmatch(name)
    return bool(MODULES.fullmatch(name) or ATTRIBUTES.fullmatch(name) or is_signal)


def posix_names(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Lines and names of what only POSIX has, and of questions which system this is."""
    for node in ast.walk(tree):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            names = [f"{node.value.id}.{node.attr}"]
        elif isinstance(node, ast.Call):
            names = [f"an argument {word.arg}" for word in node.keywords if word.arg in ARGUMENTS]
            if getattr(node.func, "id", "") in ("getattr", "hasattr") and isinstance(node.args[1], ast.Constant):
                names.append(f"{ast.unparse(node.args[0])}.{node.args[1].value}")
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and PATHS.match(node.value):
            names = [f"a path {node.value}"]
        yield from ((node.lineno, name) for name in names if is_posix(name) or name.startswith(("an argument ", "a path ")))


def test_no_other_package_uses_what_only_posix_has():
    places = [f"{file}:{line}: {name}" for file in FILES for line, name in posix_names(ast.parse(file.read_text("utf-8")))]
    assert not places, "\n".join(places)


@pytest.mark.parametrize(
    "source",
    [
        "import resource", "from pwd import getpwuid", "from multiprocessing import resource_tracker", "os.O_NOFOLLOW",
        "os.geteuid()", "hasattr(os, 'sched_getaffinity')", "os.sysconf('SC_PHYS_PAGES')", "signal.pthread_kill(0, 1)",
        "signal.SIGXCPU", "from signal import SIGKILL", "sys.platform == 'darwin'", "os.name", "open('/proc/self/status')",
        "subprocess.Popen(command, start_new_session=True)",
    ],
)  # fmt: skip
def test_a_use_of_what_only_posix_has_is_found(source):
    assert len(list(posix_names(ast.parse(source)))) == 1


@pytest.mark.parametrize("source", ["os.O_RDONLY", "signal.SIGTERM", "os.devnull", "'/home/of/nobody'", "os.replace(a, b)"])
def test_what_all_systems_have_is_allowed(source):
    assert not list(posix_names(ast.parse(source)))


def stripped(command: list, environment=MappingProxyType({}), **options):
    """A process without what only POSIX has."""
    folders = os.pathsep.join(map(str, (SCRIPTS / "without_posix", ROOT)))
    return run(list(map(str, command)), env={**os.environ, "PYTHONPATH": folders, **environment}, **options)


def python(code: str, *arguments, **options):
    return stripped([sys.executable, "-c", code, *arguments], **options)


MODEL = ROOT / "models" / "ra1.py"

COMMANDS = """
import sys
from tolcontact.__main__ import command_line
for line in sys.argv[1:]:
    sys.argv[1:] = line.split()
    try:
        command_line()
    except SystemExit as ended:
        print(f"{line} ended with {ended.code}")
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    "others",
    [[("report", "x.nc")], *nightly([("--version",), ("summary", "x.nc"), *2 * [("report", "x.nc")], ("check", MODEL)])],
)
def test_commands_work_without_what_only_posix_has(others, tmp_path):
    """One process does all commands: a file that one of them leaves open could not be replaced by the next."""
    (tmp_path / "block.step").write_text(step_block())
    resumed = ("run", MODEL, "--samples", 60, "--out", "x.nc", "--resume")
    commands = [("run", MODEL, "--samples", 50, "--out", "x.nc"), *others, resumed, ("bodies", "block.step")]
    lines = [" ".join(map(str, command)) for command in commands]
    done = python(COMMANDS, *lines, cwd=tmp_path)
    assert done.returncode == 0 and "Traceback" not in done.stderr, done.stderr
    assert all(f"{line} ended with 0\n" in done.stdout for line in lines), done.stdout
    assert sorted(path.name for path in tmp_path.iterdir()) == ["block.step", "x.html", "x.nc"]


def test_the_process_without_posix_lacks_what_windows_lacks():
    code = "import os, signal, sys\nfrom tolcontact.system.files import IS_POSIX\n"
    code += "assert not IS_POSIX and not hasattr(os, 'O_NOFOLLOW') and not hasattr(signal, 'pthread_sigmask')\nimport resource"
    assert "ModuleNotFoundError" in python(code).stderr


REPLACE_OPEN = """
import sys, threading
from pathlib import Path
from tolcontact.replacing import replacing
path = Path(sys.argv[1])
path.write_text("before")
file = path.open()
threading.Timer(float(sys.argv[2]), file.close).start()
try:
    with replacing(path) as part:
        part.write_text("after")
except OSError as error:
    print(error.strerror, error.filename)
print(path.read_text(), len(list(path.parent.iterdir())))
"""


def test_a_file_that_is_open_for_a_moment_is_replaced(tmp_path):
    assert python(REPLACE_OPEN, tmp_path / "a.xlsx", 0.1).stdout == "after 1\n"


def test_a_file_that_stays_open_is_named_with_what_to_do(tmp_path):
    first, second = python(REPLACE_OPEN, tmp_path / "a.xlsx", 5).stdout.splitlines()
    assert first.startswith("it is open in another program") and "close it" in first and first.endswith("a.xlsx")
    assert second == "before 1"


def test_a_file_that_cannot_be_replaced_for_another_reason_is_not_said_to_be_open(tmp_path):
    code = "import os, sys\nfrom pathlib import Path\nfrom tolcontact.system import files\n"
    code += "path = Path(sys.argv[1])\npath.touch()\nopened = path.open()\nos.access = lambda path, mode: False\n"
    code += "try: files.remove(path)\nexcept PermissionError as error: print(type(error).__name__)"
    assert python(code, tmp_path / "a").stdout == "PermissionError\n"


RUN_AGAIN = """
import tolcontact as tc
from models.ra1 import assembly
program = tc.build(assembly(), method=tc.Method(resolution="linearized"))
options = {"samples": 20, "out": "run.nc", "overwrite": True}
results = tc.run(program, **options)
try:
    tc.run(program, **options)
except tc.errors.ArchiveError as error:
    print(error)
results.close()
tc.run(program, **options).close()
"""


def test_a_run_says_that_its_archive_is_open_and_works_when_it_is_closed(tmp_path):
    done = python(RUN_AGAIN, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    assert "run.nc" in line and "results.close()" in line
    assert [path.name for path in tmp_path.iterdir()] == ["run.nc"]


UMLAUTS = """
import sys
import tolcontact as tc
from pathlib import Path
from models.ra1 import assembly
program = tc.build(assembly(), method=tc.Method(resolution="linearized"))
tc.run(program, samples=20).close()
out = Path(sys.argv[1])
for resume in (False, True):
    tc.run(program, samples=20, out=out, resume=resume).close()
tc.analyses.sensitivities(out, samples=20, into=out)
with tc.open_archive(out) as results:
    print(results.sizes["realization"], *results["statistics"].children, *(path.name for path in out.parent.iterdir()))
"""


@pytest.mark.slow
def test_archives_may_have_letters_beyond_ascii(tmp_path):
    folder = tmp_path / "Jürgen Ω"
    for path in (folder / "temp", tmp_path / "short", folder / "runs"):
        path.mkdir(parents=True)
    environment = {"SHORT_NAMES": str(tmp_path / "short"), "TMPDIR": str(folder / "temp")}
    done = stripped([sys.executable, "-c", UMLAUTS, folder / "runs" / "prüf.nc"], environment)
    assert done.stdout == "20 sensitivities prüf.nc\n", done.stderr


UNBUILT = """
import sys
import tolcontact as tc
def assembly():
    raise AssertionError("it is built")
for path in sys.argv[1:]:
    try:
        tc.run(assembly, out=path)
    except tc.errors.ArchiveError as error:
        print(error)
"""


def test_a_path_that_cannot_be_an_archive_is_named_before_anything_is_built(tmp_path):
    sentences = {
        tmp_path / "prüf.nc": "netCDF opens paths of 259 ASCII letters at most",
        tmp_path / ("x" * (252 - len(str(tmp_path))) + ".nc"): "Windows takes paths of 259 letters at most",
    }
    done = python(UNBUILT, *sentences)
    assert done.stderr == "" and not list(tmp_path.iterdir())
    for line, (path, sentence) in zip(done.stdout.splitlines(), sentences.items(), strict=True):
        assert line.startswith(f'archive "{path}" cannot be written: {sentence}')


def test_an_archive_that_the_library_cannot_open_is_named(tmp_path):
    path = tmp_path / "prüf.nc"
    path.touch()
    done = python("import sys, tolcontact as tc; tc.open_archive(sys.argv[1])", path)
    assert f'"{path}" cannot be read: netCDF opens paths' in done.stderr.splitlines()[-1]


PLUGINS = """
import os, sys
from tolcontact.__main__ import command_line
sys.argv[1:] = ["--version"]
try:
    command_line()
finally:
    print(os.environ.get("HDF5_PLUGIN_PRELOAD"))
"""


def test_commands_look_for_plugins_of_hdf5_only_where_that_is_quick():
    assert python(PLUGINS).stdout.splitlines()[-1] == "::"
    assert run([sys.executable, "-c", PLUGINS], env={**os.environ, "PYTHONPATH": str(ROOT)}).stdout.splitlines()[-1] == "None"


CACHE = """
from tolcontact import code_cache
code_cache.store("a", b"code")
print(code_cache.load("a"), [path.name for path in code_cache.cache_folder().iterdir()])
"""


@pytest.mark.parametrize(("place", "stored"), [("home/cache", "b'code' ['a']"), ("elsewhere", "None []")])
def test_the_cache_is_used_in_the_profile_folder_only(place, stored, tmp_path):
    (tmp_path / "home").mkdir()
    code = f"import os\nos.environ.update(HOME='{tmp_path / 'home'}', XDG_CACHE_HOME='{tmp_path / place}')\n{CACHE}"
    done = python(code)
    assert (done.stdout.strip(), done.stderr) == (stored, "")


def test_a_link_in_the_cache_is_not_followed(tmp_path):
    code = f"import os\nos.environ.update(HOME='{tmp_path}', XDG_CACHE_HOME='{tmp_path}')\n{CACHE}"
    code += "(code_cache.cache_folder() / 'link').symlink_to(code_cache.cache_folder() / 'a')\nprint(code_cache.load('link'))"
    assert python(code).stdout.splitlines()[-1] == "None"


CLUSTER = """
import signal
if hasattr(signal, "pthread_sigmask"):
    del signal.pthread_sigmask
from tolcontact.simulation.cluster import local_cluster
def ignores():
    import signal
    return signal.getsignal(signal.SIGINT) is signal.SIG_IGN
if __name__ == "__main__":
    with local_cluster(1) as client:
        client.wait_for_workers(1)
        print(list(client.run(ignores).values()))
"""


@pytest.mark.slow
def test_workers_ignore_an_interrupt_where_they_cannot_inherit_that_it_is_blocked(tmp_path):
    (tmp_path / "cluster.py").write_text(CLUSTER)
    done = run([sys.executable, tmp_path / "cluster.py"])
    assert done.stdout == "[True]\n", done.stderr


WATCH = """
import sys
from tolcontact.system import processes
waste = {"time": "while True: pass", "memory": "x = bytearray(10**9); import time; time.sleep(60)", "": "print(1)"}
for limit, code in waste.items():
    _, output, _, found = processes.run([sys.executable, "-c", code], memory=3 * 10**8, seconds=20 if limit == "" else 1)
    print(found == limit, output)
"""


def test_a_process_that_no_system_limits_is_ended_by_its_parent():
    assert python(WATCH).stdout.splitlines() == ["True b''", "True b''", "True b'1\\n'"]


@pytest.mark.parametrize(("system", "unit"), [("darwin", 1), ("linux", 1024)])
def test_peak_memory_is_in_bytes_on_every_system(system, unit):
    code = f"import resource, sys; sys.platform = {system!r}\nfrom tolcontact.system.machine import peak_memory\n"
    code += f"peak = {unit} * resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\nprint(peak <= peak_memory() < 2 * peak)"
    assert run([sys.executable, "-c", code]).stdout == "True\n"


def test_letters_that_a_code_page_lacks_become_escapes(tmp_path):
    name = tmp_path / "≤ 5.py"
    done = run([*COMMAND, "check", name], env={**os.environ, "PYTHONPATH": str(ROOT), "PYTHONIOENCODING": "cp1252"})
    assert done.returncode == 2 and "\\u2264 5" in done.stderr and "Traceback" not in done.stderr
