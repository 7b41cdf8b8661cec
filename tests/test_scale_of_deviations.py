"""Numbers in other units, absolute values and codes for missing ones are never silent; honest numbers always are."""

import re
import warnings
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
import pytest
from scipy import stats

import tolcontact as tc
from tests.helpers import nightly

# Standard tolerances of ISO 286-1 in um, for sizes of 30 to 50, 80 to 120 and 250 to 315 mm: grades 6 to 13.
GRADES = {
    40.0: (16, 25, 39, 62, 100, 160, 250, 390),
    100.0: (22, 35, 54, 87, 140, 220, 350, 540),
    300.0: (32, 52, 81, 130, 210, 320, 520, 810),
}


class Part(NamedTuple):
    """A block of a length, the width of its zone, and its random numbers."""

    assembly: tc.Assembly
    part: tc.declaration.Part
    length: float
    width: float
    rng: np.random.Generator

    def located(self, tolerance=0.0):
        faces = [self.part.face(side) for side in ("-z", "-y", "-x")]
        self.assembly.locate(self.part, tc.three_two_one(*faces, inset=2), tolerance=tolerance)

    def sized(self, factor=1.0, offset=0.0, **options):
        limit = factor * self.width / 2
        size = tc.Size(self.length, limit + offset, -limit + offset, **options)
        self.part.feature("size", self.part.face("-x"), self.part.face("+x"), size)

    @property
    def deviations(self):
        sigma = self.width / 6 / self.rng.uniform(0.5, 3)
        return self.rng.normal(self.rng.uniform(-0.3, 0.3) * self.width, sigma, self.rng.integers(20, 80))


def rows_of_a_size(block, factor, offset):
    block.located()
    block.sized()
    block.assembly.population({f"{block.part.name}.size.size": factor * block.deviations + offset})


def rows_of_a_locator(block, factor, offset):
    block.located(tolerance=block.width)
    block.assembly.population({f"{block.part.name}.A1": factor * block.deviations + offset})


def rows_without_a_zone(block, factor, offset):
    block.located()
    block.assembly.population({f"{block.part.name}.A1": factor * block.deviations + offset})


def limits_of_a_size(block, factor, offset):
    block.located()
    block.sized(factor, offset)


def distribution_of_a_size(block, factor, offset):
    block.located()
    sigma = block.width / 6 / block.rng.uniform(0.5, 3)
    block.sized(distribution=stats.norm(offset, factor * sigma))


def distribution_of_locators(block, factor, offset):
    block.located(tolerance=tc.Tolerance(distribution=stats.norm(offset, factor * block.width / 6)))


def zone_of_a_face(block, factor, offset):
    block.located()
    block.part.feature("base", block.part.face("-z"), datum="A")
    block.part.feature("top", block.part.face("+z"), tc.Profile(factor * block.width, "A", rule="translation"))


def zone_of_locators(block, factor, offset):
    block.located(tolerance=factor * block.width)
    limit = 3 * block.width
    name = f"corner of {block.part.name}"
    block.assembly.measure(name, block.part.point(block.length, 0, 20), along="x", limits=(-limit, limit))


def variable(block, factor, offset):
    block.located()
    block.sized()
    width = factor * block.rng.uniform(0.2, 1.5) * block.width
    drives = {f"{block.part.name}.size.size": 1.0}
    block.assembly.variable(f"{block.part.name} wear", tc.Tolerance(width, shift=offset), drives=drives)


UP, DOWN, INCH, TO_INCH = 1000.0, 1 / 1000, 25.4, 1 / 25.4
INPUTS: dict[Callable, tuple[tuple[float, ...], bool]] = {  # factors that are noticed, and whether an offset is
    rows_of_a_size: ((UP, DOWN, INCH, TO_INCH), True),
    rows_of_a_locator: ((UP, DOWN, INCH, TO_INCH), True),
    rows_without_a_zone: ((UP, DOWN), True),
    limits_of_a_size: ((UP, DOWN), True),
    distribution_of_a_size: ((UP, DOWN, INCH, TO_INCH), True),
    distribution_of_locators: ((UP, DOWN), True),
    zone_of_a_face: ((UP, DOWN), False),
    zone_of_locators: ((UP, DOWN), False),
    variable: ((UP, DOWN), True),
}


def model(seed, declare, factor, is_offset, numbers):
    """Blocks in a row, each with an input of its own: of one kind, or of all kinds in turn."""
    a = tc.Assembly("row")
    for number in numbers:
        rng = np.random.default_rng([seed, number])
        length = float(rng.choice(list(GRADES)))
        width = GRADES[length][rng.integers(8)] / 1000
        part = a.part(f"block {number:02d}", tc.Box(length, 30, 20), at=(0, 60 * number, 0), fixed=True)
        kind = declare or list(INPUTS)[number % len(INPUTS)]
        kind(Part(a, part, length, width, rng), factor, length if is_offset else 0.0)
        a.measure(f"end of block {number:02d}", part.point(length, 0, 20), along="x")
    return a


def silent(seed, declare, factor=1.0, *, is_offset=False, numbers=range(8)):
    """The numbers of the blocks that no fault and no warning names; a model with faults is checked again without these."""
    numbers = list(numbers)
    while numbers:
        with warnings.catch_warnings(record=True) as records:
            warnings.simplefilter("always", tc.NominalWarning)
            warnings.filterwarnings("ignore", r"\[effect\]")  # the ends are measured on the parts alone
            faults = tc.check(model(seed, declare, factor, is_offset, numbers))
        said = "\n".join(faults or [str(record.message) for record in records])
        numbers = [number for number in numbers if f"block {number:02d}" not in said]
        if not faults:
            break
    return numbers


@pytest.mark.parametrize("seed", [0, 1, *nightly(*range(2, 6))])
def test_honest_numbers_are_silent(seed):
    assert silent(seed, None, numbers=range(36)) == list(range(36))


@pytest.mark.parametrize("declare", INPUTS, ids=lambda declare: declare.__name__)
def test_numbers_in_other_units_are_never_silent(declare):
    assert not {factor: numbers for factor in INPUTS[declare][0] if (numbers := silent(1, declare, factor))}


@pytest.mark.parametrize("declare", [kind for kind in INPUTS if INPUTS[kind][1]], ids=lambda declare: declare.__name__)
def test_absolute_values_are_never_silent(declare):
    assert not silent(1, declare, is_offset=True)


def sized(values, **options):
    a = tc.Assembly("block")
    part = a.part("block", tc.Box(50, 30, 20))
    block = Part(a, part, 50.0, 0.2, np.random.default_rng(0))
    block.located()
    block.sized()
    a.population({"block.size.size": values}, **options)
    a.measure("end", part.features[0].point(50, 0, 0), along="x")
    return a


VALUES = np.random.default_rng(3).normal(0.01, 0.03, 30)
CAUSES = {
    "absolute": (50 + VALUES, {"absolute": True}),
    "um": (1000 * VALUES, {"units": "um"}),
    "m": (VALUES / 1000, {"units": "m"}),
    "inches": (VALUES / 25.4, {"units": "in"}),
    "absolute inches": ((50 + VALUES) / 25.4, {"absolute": True, "units": "in"}),
    "absolute metres": ((50 + VALUES) / 1000, {"absolute": True, "units": "m"}),
    "absolute micrometres": (1000 * (50 + VALUES), {"absolute": True, "units": "um"}),
}


@pytest.mark.parametrize("cause", CAUSES)
def test_the_arguments_that_a_sentence_names_cure_it(cause):
    values, options = CAUSES[cause]
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        said = [*tc.check(sized(values)), *(str(record.message) for record in records)]
    (text,) = said
    named = re.search(r"population\(\.\.\., (.*)\) reads", text)[1]
    assert named == ", ".join(f'{name}="{value}"' if name == "units" else f"{name}={value}" for name, value in options.items())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        program = tc.build(sized(values, **options))
    assert program.nominal.assembly.populations[0].values[:, 0] == pytest.approx(VALUES, abs=1e-12)


@pytest.mark.parametrize(("code", "row"), [(-999, 31), (9999, 31), (-1.0, 31)])
def test_codes_for_missing_values_are_named_by_their_row(code, row):
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        (text,) = [*tc.check(sized([*VALUES, code])), *(str(record.message) for record in records)]
    assert f"row {row} of block.size.size is {code:g}, far from the others" in text


def test_absolute_values_are_for_sizes():
    a = sized(VALUES)
    with pytest.raises(ValueError, match=r'absolute=True is for sizes \("part.feature.size"\)'):
        a.population({"block.A1": VALUES}, absolute=True)
    with pytest.raises(ValueError, match="units is 'inch'; expected one of: um, mm"):
        a.population({"block.A1": VALUES}, units="inch")


@pytest.mark.parametrize(
    ("limits", "message"),
    [
        ((50.1, 49.9), r"its limits are 50.1 and 49.9 .* deviations from the nominal size, as in tc.Size\(50, \+0.1, -0.1\)"),
        ((100, -100), r"lower limit -100 leaves nothing of a size of 50 mm; .* divide micrometres by 1000"),
        ((0, 0), "both limits are 0, so the size does not vary; leave the size out"),
    ],
)
def test_limits_that_are_no_deviations_are_refused(limits, message):
    faults = list(tc.Size(50, *limits).faults())
    assert len(faults) == 1 and re.search(message, faults[0])


def test_a_variable_in_inches_is_refused_where_it_drives_lengths():
    a = sized(VALUES)
    a.variable("A", 0.031, drives={"block.A1": 1.0}, units="in")
    (fault,) = tc.check(a)
    assert re.search(r'variable "A" .*: units is "in", and nothing is converted; .* its tolerance times 25.4', fault)


@pytest.mark.parametrize(("factor", "count"), [(1.0, 0), (1000.0, 1)])
def test_a_population_of_a_variable_in_micrometres_is_noticed(factor, count):
    a = tc.Assembly("block")
    block = Part(a, a.part("block", tc.Box(50, 30, 20)), 50.0, 0.2, np.random.default_rng(0))
    block.located(0.1)
    a.variable("A", 0.1, drives={"block.A1": 1.0})
    a.population({"A": factor * block.deviations})
    a.measure("end", block.part.point(50, 0, 0), along="x")
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        tc.check(a)
    assert [("to block.A1, which does not fit" in str(one.message)) for one in caught] == [True] * count


@pytest.mark.parametrize("units", ["mm", "in"])
@pytest.mark.parametrize("zone", [0.1, 0.0, 3.0])
def test_a_population_of_absolute_lengths_of_a_link_is_noticed(units, zone):
    def said(values):
        stack = tc.Stack("stack", units=units)
        stack.link("disc", 6.6, zone)
        stack.gap("gap")
        stack.population({"disc": values})
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            assert not tc.check(stack)
        return [str(one.message) for one in caught if "[units]" in str(one.message)]

    assert not said([0.01, -0.01, 0.02])
    if zone > 1:  # as wide as a coarse casting: nothing is certain
        assert not said([6.61, 6.59, 6.6])
        return
    (text,) = said([6.61, 6.59, 6.6])
    assert re.search(
        rf'^\[units\] population "of 3 rows" .*: disc is around 6.6 {units}, near its nominal value, and deviations from it '
        r'are expected; subtract it, as in population\(\{"disc": values - 6.6\}\)$',
        text,
    )


def test_a_capability_in_per_cent_is_noticed():
    a = tc.Assembly("block")
    block = Part(a, a.part("block", tc.Box(50, 30, 20)), 50.0, 0.2, np.random.default_rng(0))
    block.located(tc.Tolerance(0.2, cp=133))
    a.measure("end", block.part.point(50, 0, 0), along="x")
    with pytest.warns(tc.NominalWarning, match=r"its cp is 133, which no process has; a capability of 133 % is 1.33"):
        tc.check(a)
