"""What many tests do: simulate into arrays, call the command line, run a script of `tests/scripts`, compare archives."""

import contextlib
import io
import os
import signal
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tolcontact.cli import command_line
from tolcontact.compilation import compile_program
from tolcontact.declaration import script as models_as_data
from tolcontact.discretization import discretize
from tolcontact.simulation import Block, simulate_blocks
from tolcontact.workflow.models import DEFAULT_SOLVER, assembly_of, method_of

ROOT = Path(__file__).resolve().parents[1]
SCRIPTS = ROOT / "tests" / "scripts"
COMMAND = [sys.executable, "-m", "tolcontact"]

posix_only = pytest.mark.skipif(
    os.name != "posix", reason="users with numbers, signals between processes and named pipes are of POSIX"
)

WAITING = 300  # s after which a process that a test waits for is ended; a loaded machine needs many times what an idle one does

PAPER = tc.Method(resolution="linearized")
FIXED = tc.Method(search="fixed")  # planes of the contact points do not end
EXACT = tc.Method(resolution="exact")
ALL_POINTS = tc.Method(resolution="exact", objective="all points")
SEATED = tc.Method(resolution="exact", objective="seating")
SEATED_ON_POINTS = tc.Method(objective="seating", search="fixed")


def nightly(*values):
    """Return parameters of items that run at night only; the other items prove the same claim."""
    return [pytest.param(*(value if isinstance(value, tuple) else (value,)), marks=pytest.mark.nightly) for value in values]


def compiled(model, *, solver=DEFAULT_SOLVER, method=None):
    """The program of a model, as of `tc.build`, without the check of the nominal assembly, which resolves 128 realizations."""
    assembly = assembly_of(model)
    choice = method_of(assembly, method)
    return compile_program(discretize(assembly, presses=choice.minimizes.presses), solver, choice)


def json_schema():
    """The schema of models as data, which `python -m tolcontact.declaration.script` prints."""
    return models_as_data.json_schema()


def simulate(model, samples=200, seed=1, block=1000, build=compiled, **options):
    """The program, and its blocks joined to one: arrays by name."""
    program = build(model, **options)
    return program, joined(simulate_blocks(program, samples=samples, seed=seed, block=block))


def realizations(program, samples, seed=1):
    """What a run has of each realization, as its results have it, without an archive."""
    rows = tc.simulate(program, samples, seed=seed).compute()
    return xr.DataTree.from_dict({"/": rows.drop_vars("deviation"), "/sample": rows[["deviation"]]})


def joined(blocks):
    """Arrays (realization, ...) by name, of blocks one after the other."""
    whole = vars(Block.joined(blocks))
    return {name: values for name, values in whole.items() if name != "start"}


def R_t(poses):
    """R (..., 3, 3) and t (..., 3) [mm] of poses (..., 12)."""
    return poses[..., :9].reshape(*poses.shape[:-1], 3, 3), poses[..., 9:]


def placed(points, poses):
    """Where points (point, 3) [mm] are at poses (..., 12): (..., point, 3) [mm]."""
    R, t = R_t(poses)
    return points @ R.swapaxes(-1, -2) + t[..., None, :]


def moved_at_locators(part, poses):
    """How far (..., locator) [mm] a part at poses (..., 12) has moved at its locators, along their directions."""
    return ((placed(part.locators.points, poses) - part.locators.points) * part.locators.directions).sum(axis=-1)


@dataclass
class Done:
    """What a command has printed, and its exit code."""

    returncode: int
    stdout: str
    stderr: str


def call(folder, *arguments):
    """The command line in this process, started in `folder`."""
    out, err = io.StringIO(), io.StringIO()
    with contextlib.chdir(folder), contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
        try:
            command_line([str(argument) for argument in arguments])
        except SystemExit as ended:
            return Done(ended.code, out.getvalue(), err.getvalue())
    raise AssertionError("the command line ended without an exit code")


def script(name, *arguments):
    """The command that runs a script of `tests/scripts`, or another one of which the path is given without its ending."""
    return [sys.executable, SCRIPTS / f"{name}.py", *map(str, arguments)]


def start(command, *, env=None, **options):
    """A process with this project's modules. It heeds interrupts, also where this one, a job in the background, does not."""
    env = env or os.environ | {"PYTHONPATH": str(ROOT)}
    pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
    before = signal.signal(signal.SIGINT, signal.SIG_DFL)
    try:
        return subprocess.Popen(command, env=env, text=True, **(pipes | options))
    finally:
        signal.signal(signal.SIGINT, before)


def finish(process, said=None, timeout=WAITING):
    """What a process has printed in the end, to be told something first; it is ended where it does not end."""
    try:
        out, err = process.communicate(said, timeout=timeout)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        raise
    return Done(process.returncode, out, err)


def run(command, *, timeout=WAITING, **options):
    """Start a process and wait for its end."""
    return finish(start(command, **options), timeout=timeout)


CHECKPOINTS = ("summed_rows", "sums")


def contents(path, group=None):
    """A group of an archive, but for what two runs to the same rows may differ in: when they began, and their checkpoints."""
    found = xr.load_dataset(path, group=group).drop_vars(CHECKPOINTS, errors="ignore")
    found.attrs.pop("history", None)
    return found


def layout(path):
    """The storage of every variable of an archive, and all attributes but the history: what is not data."""
    groups, stored = [netCDF4.Dataset(path)], {}
    with groups[0]:
        while groups:
            group = groups.pop()
            groups += group.groups.values()
            for thing in (group, *group.variables.values()):
                name = thing.path if thing is group else f"{group.path}/{thing.name}"
                stored[name] = {key: np.asarray(thing.getncattr(key)).tolist() for key in thing.ncattrs() if key != "history"}
                if thing is not group:
                    stored[name] |= {"kind": (thing.dtype, thing.dimensions, thing.shape), "filters": thing.filters()}
                    stored[name] |= {"chunks": thing.chunking()}
    return stored


def assert_same_archive(found, expected):
    """Every variable of two archives, to the last bit; which checkpoint was the last depends on time."""
    with xr.open_datatree(found) as one, xr.open_datatree(expected) as other:
        assert one.groups == other.groups
        for group in one.groups:
            for name in other[group].data_vars:
                if name not in CHECKPOINTS:
                    np.testing.assert_array_equal(one[group][name].values, other[group][name].values, err_msg=f"{group} {name}")


def model_in(path):
    """The model of an archive, which is closed again."""
    with tc.open_archive(path) as archive:
        return tc.io.model_of(archive)
