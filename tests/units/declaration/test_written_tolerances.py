"""Insides of `declaration` under the claims of `tests/test_written_tolerances.py`."""

import numpy as np
import pytest

import tolcontact as tc
from tolcontact.declaration.written_tolerance import text_fault, written

LIMITS = {
    "±0.1": (-0.1, 0.1), "+-0.1": (-0.1, 0.1), "+/-0.1": (-0.1, 0.1), "± 0.1 mm": (-0.1, 0.1), "±.1": (-0.1, 0.1),
    "+0.1/-0.05": (-0.05, 0.1), "+0.1 -0.05": (-0.05, 0.1), "+0.1-0.05": (-0.05, 0.1), "-0.05/+0.1": (-0.05, 0.1),
    "+ 0.1 / - 0.05": (-0.05, 0.1), "+0.1 mm / -0.05 mm": (-0.05, 0.1), "+0.1; -0.05": (-0.05, 0.1),
    "+0.1, -0.05": (-0.05, 0.1), "+0.1/\N{MINUS SIGN}0.05": (-0.05, 0.1), "+0,1/-0,05": (-0.05, 0.1), "±0,025": (-0.025, 0.025),
    "+0.1/0": (0, 0.1), "0 -0.05": (-0.05, 0), "+0.1\N{NO-BREAK SPACE}-0.05": (-0.05, 0.1), "-0.1/-0.2": (-0.2, -0.1),
    "+0.05/+0.1": (0.05, 0.1), "±1e-2": (-0.01, 0.01),
}  # fmt: skip


@pytest.mark.parametrize("text", LIMITS)
def test_a_text_states_limit_deviations(text):
    assert written(text) == LIMITS[text]


@pytest.mark.parametrize(("text", "number"), [("0.2", 0.2), ("0,2", 0.2), ("0.2 mm", 0.2), ("0.2mm", 0.2), (" 3 ", 3.0)])
def test_a_text_of_a_number_is_that_number(text, number):
    assert written(text) == number
    assert tc.Tolerance(text) == tc.Tolerance(number)


REFUSED = {
    "+0.1": 'write "+0.1/0" if the other one is 0, "±0.1" for both sides', "-0.1": 'write "0/-0.1"', "1,000": "thousands",
    "±50 kg": "its unit is kg; expected mm", "±0.1 rad": "its unit is rad; expected mm", "±1°": "its unit is °",
    "9.9/10.1": "a limit has no sign", "H7": 'for sizes, as in tc.Size(10, "H7")', "H7/g6": 'give "H7" to the hole, and "g6"',
    "q7": 'no letters "q"', "": 'such as "±0.1"', "±": 'such as "±0.1"', "about 0.1": 'such as "±0.1"', "±1e999": "up to 1e+15",
    "nan": 'such as "±0.1"', "±-0.1": 'such as "±0.1"', "+0.1/-0.05/0": 'such as "±0.1"', "9" * 100_000: "up to 1e+15",
    "\N{LATIN SMALL LETTER A}" * 100_000: 'such as "±0.1"', "+0.1\n-x": 'such as "±0.1"',
}  # fmt: skip


@pytest.mark.parametrize("text", REFUSED, ids=lambda text: text[:12])
def test_other_texts_are_refused_with_what_to_write(text):
    fault = text_fault(text)
    assert REFUSED[text] in fault
    assert len(fault) < 250


@pytest.mark.parametrize(
    ("pair", "reason"),
    [((0.1, -0.05), "swap them"), ((0.1,), "expected two numbers"), ((1, 2, 3), "two numbers"), (("a", 1), "two numbers")],
)
def test_pairs_are_a_lower_and_an_upper_limit(pair, reason):
    assert reason in text_fault(pair)


def test_units_of_a_measure_are_those_of_its_tolerance():
    def tilt(poses):
        return poses.rotation(part)[2, 0]

    model = tc.Assembly("a")
    part = model.part("block", tc.Box(1, 1, 1), fixed=True)
    model.measure("tilt", tilt, units="rad", tolerance="±0.01 rad")
    model.measure("tilt in degrees", tilt, units="rad", tolerance="+1°/-0.5°")
    assert model.measures[0].tolerance == 0.02
    assert model.measures[1].tolerance == pytest.approx((-np.pi / 360, np.pi / 180))
    assert written("±0.5 deg", units="rad") == pytest.approx((-np.pi / 360, np.pi / 360))
    assert tc.check(model) == ()
