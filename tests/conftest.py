"""Fixtures of several test modules; and the shapes of arrays, which are checked in the tests of some modules."""

import contextlib
import ctypes
import gc
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import jaxtyping
import pytest

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # as a command does; it reaches the workers of xdist
PACKAGE = Path(__file__).resolve().parents[1] / "tolcontact"
ROOMS = (
    "contact",
    "compilation",
    "simulation",
)  # whose functions check the shapes of their arguments, before anything imports them
CHECKED = [
    ".".join(file.relative_to(PACKAGE.parent).with_suffix("").parts)
    for room in ROOMS
    for file in sorted((PACKAGE / room).rglob("*.py"))
    # Numba compiles no function that something is wrapped around.
    if file.name != "__init__.py" and not file.name.endswith("kernel.py")
]
CHECKER = "beartype.beartype(conf=beartype.BeartypeConf(is_pep484_tower=True))"
# Modules whose tests call the functions of these rooms in every way: flat, round and springy contact, stations, form.
CHECKING = {
    f"test_{name}"
    for name in (
        "contact", "contact_points", "engine", "ends", "floating", "form", "free_steps", "graph_solver", "interference",
        "other_starts", "round_contact", "round_objective", "seating", "springs", "stations", "threads",
    )
}  # fmt: skip
WITH_SHAPES, WITHOUT_SHAPES = "shapes", "others"


def pytest_addoption(parser):
    parser.addoption("--nightly", action="store_true", help="run the tests marked nightly too")
    steps, help_text = (
        (WITH_SHAPES, WITHOUT_SHAPES),
        "run tests/units and modules that check the shapes of arrays, or all others",
    )
    parser.addoption("--step", choices=steps, help=help_text)


def pytest_configure(config):
    """Have functions check shapes; decorating all of them takes a while, which no process needs that checks none."""
    if config.getoption("step") != WITHOUT_SHAPES:
        jaxtyping.install_import_hook(CHECKED, CHECKER)


def pytest_ignore_collect(collection_path, config):
    """Collect only what is of the chosen step."""
    if (step := config.getoption("step")) is None or collection_path.suffix != ".py":
        return None
    checks = collection_path.stem in CHECKING or "units" in collection_path.relative_to(config.rootpath).parts
    return True if checks != (step == WITH_SHAPES) else None


def pytest_collection_finish():
    """Take the modules and the tests out of the garbage collector's sight: nothing frees them before the end."""
    gc.collect()
    gc.freeze()


GROWTH = 300 * 2**20  # bytes of memory that a process may grow by before it gives some back, which takes a while
_memory = [0]  # of this process, when it last gave some back


def _memory_in_use() -> int | None:
    """Return the bytes of memory of this process; None where the system does not list them."""
    with contextlib.suppress(OSError, AttributeError):
        return os.sysconf("SC_PAGE_SIZE") * int(Path("/proc/self/statm").read_text().split()[1])
    return None


@pytest.fixture(scope="module", autouse=True)
def _freed_memory():
    """Now and then, give the memory of what modules made back to the system: hundreds of modules share a process."""
    yield
    if sources := sys.modules.get("tests.sources"):
        sources.tree.cache_clear()
    in_use = _memory_in_use()
    if in_use is None or in_use > _memory[0] + GROWTH:
        gc.collect()
        with contextlib.suppress(OSError, AttributeError):  # the C library may be another one
            ctypes.CDLL(None).malloc_trim(0)
        _memory[0] = _memory_in_use() or 0


def pytest_collection_modifyitems(config, items):
    """Deselect the tests marked nightly, unless `--nightly` or `-m` asks for them."""
    if config.getoption("--nightly") or "nightly" in config.getoption("markexpr"):
        return
    nightly = [item for item in items if item.get_closest_marker("nightly")]
    if nightly:
        config.hook.pytest_deselected(items=nightly)
        items[:] = [item for item in items if not item.get_closest_marker("nightly")]


@pytest.fixture(scope="session")
def archive(tmp_path_factory):
    """An archive of 300 realizations of the stack. Copy it to change it."""
    import tolcontact as tc  # noqa: PLC0415  (the hook must be there first)
    from tests import cases  # noqa: PLC0415

    path = tmp_path_factory.mktemp("archive") / "stack.nc"
    tc.run(cases.stack(), samples=300, seed=3, solver="daqp", out=path).close()
    return path


@pytest.fixture(scope="session", autouse=True)
def forked_reader():
    """Archives and shape files are read by forks of two processes, where a test does not change the environment."""
    from tests.forked_reader import ForkedReader  # noqa: PLC0415  (the hook must be there first)
    from tests.forked_shape_reader import ForkedShapeReader  # noqa: PLC0415

    reader, shape_reader, popen = ForkedReader(), ForkedShapeReader(), subprocess.Popen

    class ProcessOrFork(popen):
        """A process, or a fork that does the same."""

        def __new__(cls, command, *arguments, **options):
            if cls is ProcessOrFork and reader.reads(command, options):
                return reader.answer(command)
            if cls is ProcessOrFork and shape_reader.reads(command, options):
                return shape_reader.start(command, options["stderr"])
            return super().__new__(cls)

    subprocess.Popen = ProcessOrFork
    yield reader
    subprocess.Popen = popen
    reader.close()
    shape_reader.close()


@pytest.fixture(autouse=True)
def shapes_are_checked(request):
    """Checking takes half as long again where there are many small calls: not in slow tests, nor in other modules."""
    checks = request.module.__name__.rpartition(".")[2] in CHECKING and not request.node.get_closest_marker("slow")
    jaxtyping.config.update("jaxtyping_disable", not checks)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@pytest.fixture
def early_process(tmp_path):
    """A process that was started before its files are known, by a model that names one of them."""
    (tmp_path / "model.py").write_text('part = tc.Mesh("block.step")')
    from tolcontact import shape_worker  # noqa: PLC0415  (the hook must be there first)

    worker = shape_worker.start_early(["--samples", "20", str(tmp_path / "model.py")])
    process = worker.process
    yield process
    shape_worker.end_unused()
    process.wait()


@pytest.fixture(scope="session")
def drawing():
    """Bodies can be drawn here; where there is no OpenGL, not even in software, the process that tries it dies."""
    script = "import pyvista as pv; p = pv.Plotter(off_screen=True); p.add_mesh(pv.Sphere()); p.screenshot(return_img=True)"
    if subprocess.run([sys.executable, "-c", script], capture_output=True, timeout=120, check=False).returncode:
        pytest.skip("there is no OpenGL")


@pytest.fixture(scope="module")
def browser():
    """A browser for all tests of a file. It cannot stay longer: its event loop runs in this thread until it ends."""
    if (chromium := shutil.which("chromium")) is None:
        pytest.skip("there is no Chromium")
    from playwright.sync_api import sync_playwright  # noqa: PLC0415  (no other test needs it)

    with sync_playwright() as driver:
        options = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        options += ["--disable-background-networking", "--disable-component-update", "--disable-sync", "--no-first-run"]
        opened = driver.chromium.launch(executable_path=chromium, args=options)
        yield opened
        opened.close()


@pytest.fixture
def open_page(browser):
    """Opens a page, of a width; what it complains of, or asks the network for, fails the test."""
    wrong, pages = [], []

    def open_(path, width=1280, drawn="#scene"):
        opened = browser.new_page(viewport={"width": width, "height": 900})
        pages.append(opened)
        opened.on("console", lambda message: wrong.append(message.text))
        opened.on("pageerror", lambda error: wrong.append(str(error)))
        opened.on("dialog", lambda dialog: wrong.append(dialog.message))
        opened.on(
            "request", lambda request: request.url == path.as_uri() or request.url[:5] == "blob:" or wrong.append(request.url)
        )
        opened.goto(path.as_uri())
        opened.wait_for_selector(drawn)
        opened.wait_for_function(f"window.viewer !== undefined || {json.dumps(drawn)} !== '#scene'")
        return opened

    yield open_
    for opened in pages:
        opened.close()
    assert not wrong


READ = "-all,+dac_read_search"  # everything may be read
AS_NOBODY = ["setpriv", "--reuid", "65534", "--regid", "65534", "--clear-groups"]
AS_NOBODY += [f"--bounding-set={READ}", f"--inh-caps={READ}", f"--ambient-caps={READ}"]


@pytest.fixture
def nobody():
    """The command that makes one run as a user who can write nowhere."""
    done = shutil.which("setpriv") and subprocess.run([*AS_NOBODY, sys.executable, "-c", ""], check=False)
    if not done or done.returncode:
        pytest.skip("only root may become another user")
    return AS_NOBODY
