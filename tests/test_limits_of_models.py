"""What a model, an option or a file may ask for has limits; what is more is refused at once, with its place."""

import json
import re
import time

import pytest
import scipy.stats

import tolcontact as tc
from tests.helpers import ROOT, call, compiled
from tests.test_json_models import PLAIN

RA1 = "models/ra1.py"


def changed(*path, value):
    document = json.loads(json.dumps(PLAIN))
    *way, last = path
    at = document
    for key in way:
        at = at[key]
    at[last] = value
    return document


def tape(steps):
    return [["input", 3], *(["sin", k] for k in range(steps))]


TOO_MUCH = {
    "points": (changed("pairs", 0, "points", value=10**9), r"pairs\[0\].points: points is 1000000000; expected .* to 100000"),
    "spacing": (changed("pairs", 0, "spacing", value=1e-9), "a spacing of 1e-09 mm gives .* contact points; expected at most"),
    "parts": (changed("parts", value=[PLAIN["parts"][1]] * 100_000), "parts: it has 100000 entries; expected at most 1000"),
    "measures": (changed("measures", value=PLAIN["measures"] * 3000), "measures: it has 3000 entries; expected at most 2000"),
    "steps": (
        changed("measures", 0, value={"name": "t", "units": "1", "tape": tape(100_001)}),
        r"measures\[0\].tape: it has more than 100000 steps",
    ),
    "draws": (
        changed("locations", 0, "tolerance", value={"scipy": "studentized_range", "args": [3, 10]}),
        r"locations\[0\].tolerance: a draw of scipy.stats.studentized_range takes .* ms",
    ),
    "name": (changed("measures", 0, "name", value="a" * 10**6), "the name has 1000000 characters; expected at most 500"),
    "along": (changed("measures", 0, "along", value=[0, 0, 0]), r"measures\[0\].along: .* nonzero vector"),
}


@pytest.mark.parametrize("name", TOO_MUCH)
def test_a_model_that_asks_for_too_much_is_refused_at_once(name, tmp_path):
    document, message = TOO_MUCH[name]
    (tmp_path / "m.json").write_text(json.dumps(document))
    began = time.process_time()
    with pytest.raises((tc.errors.ScriptError, tc.ModelError), match=message) as caught:
        tc.build(tmp_path / "m.json")
    assert time.process_time() < began + 20 and len(str(caught.value)) < 1000


def named(part, station):
    a = tc.Assembly("names")
    block = a.part(part, tc.Box(50, 25, 10))
    check = a.station(station)
    check.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0.5)
    check.measure("height", block.point(0, 0, 0), along="z")
    return a


def test_names_of_parts_and_stations_are_as_long_as_those_of_groups_in_an_archive(tmp_path):
    """In UTF-8 an umlaut takes two bytes, or three as a letter and its dots, which the archive composes."""
    longest = "ö" * 127
    tc.run(compiled(named("o\u0308" * 127 + "s", longest + "s")), samples=4, seed=1, out=tmp_path / "long.nc")
    part_fault, station_fault = tc.check(named("ö" * 128, longest + "st"))
    assert part_fault.startswith(f"part {'ö' * 40!r}...: the name takes 256 bytes in UTF-8; expected at most 255 (the archive")
    assert station_fault.startswith(f"station {'ö' * 40!r}...: the name takes 256 bytes")


def test_a_name_that_stands_twice_is_refused(tmp_path):
    (tmp_path / "m.json").write_text(json.dumps(PLAIN).replace('"inset": 5', '"inset": 5, "inset": 6'))
    with pytest.raises(tc.errors.ScriptError, match='"inset" stands twice'):
        tc.build(tmp_path / "m.json")


def test_usual_distributions_are_quick_enough():
    for frozen in (scipy.stats.norm(0, 0.1), scipy.stats.beta(2, 3), scipy.stats.ksone(22), scipy.stats.skewnorm(4)):
        assert not list(tc.Tolerance(distribution=frozen).faults())


@pytest.mark.parametrize(
    ("command", "message"),
    [
        (["run", RA1, "--surfaces", 10**12], "surfaces is 1000000000000; expected a whole number from 0 to 1000000"),
        (["run", RA1, "--samples", 10**13], "samples is .* expected a whole number from 2 to"),
        (["tails", RA1, "--samples", 10**12], "2000000000000 realizations need .* of memory"),
        (["contributions", RA1, "--samples", 10**12], "realizations need .* of memory"),
        (["sensitivities", RA1, "--samples", 10**12], "realizations need .* of memory"),
        (["worst", RA1, "--samples", 10**12], "realizations need .* of memory"),
        (["compare", RA1, "--samples", 10**12], "realizations need .* of memory"),
    ],
)
def test_what_cannot_end_is_refused(command, message):
    done = call(ROOT, *command)
    assert done.returncode == 2
    assert re.search(message, done.stderr), done.stderr


def test_an_interval_can_be_asked_to_be_as_narrow_as_nothing():
    done = call(ROOT, "run", RA1, "--samples", 100, "--until", "corner height: mean +-1e-300", "--quiet")
    assert done.returncode == 1 and "+- 1e-300 needs more than 100000000" in done.stderr
