"""Whole bodies touch where they came in: not at faces that they are nominally beyond."""

import functools
import warnings

import numpy as np
import pytest

import tolcontact as tc
from studies.certificates.ends import judged, scene
from tests.cases.laps import CASES, case
from tests.helpers import compiled, nightly, realizations
from tests.test_ends import FAULTS
from tolcontact.vocabulary import Status

# Some of several shapes that differ little: a lap of any size, steps, walls.
AT_NIGHT = ("lap of two corners", "lap of a wider box", "low step", "two walls", "wall shorter than the box")


# Doubtful realizations, by name and `reverses`: the objective of a strip of 0.3 mm falls until it is turned by 17 degrees.
DOUBTFUL = {("lap below the range", True): 1}


@functools.cache
def program_of(name, **options):
    return compiled(case(name, **options)[0], solver="daqp")


@pytest.mark.parametrize(("samples", "reverses"), [(20, False), *nightly((40, False), (40, True))])
@pytest.mark.parametrize("name", [*(name for name in CASES if name not in AT_NIGHT), *nightly(*AT_NIGHT)])
def test_whole_bodies_are_resolved(name, samples, reverses):
    options = {"reverses": True} if reverses else {}
    counts, _ = judged(program_of(name, **options), case(name, **options)[1], samples, 1, None)
    assert {fault: counts[fault] for fault in FAULTS} == dict.fromkeys(FAULTS, 0)
    assert counts["certified"] == samples - DOUBTFUL.get((name, reverses), 0)


@pytest.mark.parametrize("seed", [10, *nightly(13, 15, 22, 37)])
def test_whole_surfaces_of_random_bodies(seed):
    counts, _ = judged(*scene(seed, whole=True), 4, seed, "daqp")
    assert {fault: counts[fault] for fault in FAULTS} == dict.fromkeys(FAULTS, 0)
    assert counts["certified"] == 4


@pytest.mark.parametrize("name", ["lap", *nightly("long lap", "lap of a wider box")])
def test_whole_bodies_touch_as_the_planes_between_them(name):
    """The same depth before contact, and the same status, as of underside and top, declared by name."""
    whole, *partly = (
        realizations(program_of(name, **faces), samples=60, seed=2)
        for faces in ({}, *({"faces": faces} for faces in (("-z", "+z"), ("-z", None), (None, "+z"))))
    )
    assert 10 < (whole.status == Status.RESOLVED).sum() < 60
    for run in partly:
        assert np.array_equal(run.status, whole.status)
        depths = [np.minimum(of.gap_min.sel(state="raw"), 0) for of in (run, whole)]
        assert depths[0].values == pytest.approx(depths[1].values, abs=1e-9)


@pytest.mark.parametrize("name", ["step", *nightly("lap")])
def test_the_frame_of_whole_bodies_does_not_matter(name):
    programs = program_of(name), program_of(name, turn=(0.3, -0.5, 1.1))
    runs = [realizations(program, samples=30) for program in programs]
    assert np.array_equal(runs[0].status, runs[1].status)
    raw = [run.gap_min.sel(state="raw").values for run in runs]
    assert raw[0] == pytest.approx(raw[1], abs=1e-7)


def test_nothing_is_computed_of_the_mean_normal_of_a_closed_body():
    with warnings.catch_warnings():
        warnings.simplefilter("error", RuntimeWarning)
        tc.run(case("lap")[0], samples=10, seed=1)
