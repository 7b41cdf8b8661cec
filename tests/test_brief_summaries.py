"""Summaries of many measurements and parts in a terminal: what falls short is shown, others are counted, nothing is cut."""

import io

import casadi as ca
import pytest
from rich.console import Console

import tolcontact as tc
from tests.helpers import call, compiled
from tolcontact.report import summary_text

COUNT = 9


def many_gaps():
    """Gaps of a stack: one without limits, two whose limits are too narrow, six that meet theirs."""
    stack = tc.Stack("gaps")
    for k in range(COUNT):
        stack.link(f"link {k}", 4200, 0.002)
        stack.gap(f"gap {k}", {f"link {k}": -1}, limits=None if k == 0 else (-4200.01, -4199.99 if k < 7 else -4200))
    return stack


def many_parts():
    """Blocks beside each other, each lifted less far than the one before, by contact with a table, except for the last two."""
    a = tc.Assembly("row")
    table = a.part("table", tc.Box(400, 60, 10), fixed=True)
    for k in range(COUNT):
        block = a.part(f"block {k}", tc.Box(20, 20, 10), at=(40 * k, 10, 10 if k < COUNT - 2 else 11))
        a.locate(block, tc.three_two_one(*(block.face(f"-{axis}") for axis in "zyx"), inset=2), tolerance=0.1 * (COUNT - k))
        a.contact(f"under {k}", moving=block.face("-z"), reference=table.face("+z"), points=4)
    a.measure("height", block.point(10, 10, 0), along="z")
    return a


def printed(summary, width=80, **options):
    """The text of a summary in a terminal, and in one line."""
    text = io.StringIO()
    console = Console(file=text, width=width, force_terminal=True, color_system=None, highlight=False, markup=False)
    console.print(summary_text(summary, **options))
    return text.getvalue(), " ".join(text.getvalue().split())


def test_many_measurements_are_shortened_to_those_that_fall_short(tmp_path):
    tc.run(compiled(many_gaps()), samples=2000, seed=1, out=tmp_path / "gaps.nc")
    summary = tc.summarize(tmp_path / "gaps.nc")
    (brief, line), (whole, _) = printed(summary), printed(summary, is_whole=True)
    assert [f"gap {k}" in brief for k in range(COUNT)] == [False] * 7 + [True] * 2
    assert "gap 7: does not meet its limits gap 8: does not meet its limits 1 more without limits, 6 more meet their" in line
    assert "; the page has all, and so has tolcontact summary --all" in line
    assert all(f"gap {k}: meets its limits" in whole for k in range(1, 7)) and "kurtosis" in whole and "kurtosis" not in brief
    assert printed(summary.isel(measure=slice(1, 7)))[1].count("meets its limits") == 6
    assert "kurtosis" in printed(summary.isel(measure=slice(3)))[0]
    outputs = [call(tmp_path, "summary", "gaps.nc", *options).stdout for options in ([], ["--all"])]
    assert ["kurtosis" in output for output in outputs] == [False, True]


def test_undecided_measurements_and_those_that_are_no_numbers_are_not_hidden():
    """Twenty realizations leave six of the gaps undecided; the root of a negative height is no number."""
    assert (
        "2 more undecided, 1 more without limits; "
        in printed(tc.summarize(tc.run(compiled(many_gaps()), samples=20, seed=1)))[1]
    )
    a = many_parts()
    for k in range(COUNT):
        a.measure(f"place {k}", a.parts[1].point(k, 0, 0), along="z")
    a.measure("root", lambda poses: ca.sqrt(poses.position(a.parts[1].point(5, 5, 10))[0] - 5))
    text = printed(tc.summarize(tc.run(compiled(a), samples=20, seed=1, surfaces=0)))[1]
    assert "root: not a number" in text and "place 0" not in text and f"{COUNT + 1} more without limits" in text


def test_what_is_no_number_is_not_among_what_falls_short():
    """Seven measurements fail, one is never a number: it is shown, or counted on its own where there are many such."""
    a = many_parts()
    top = a.parts[1].point(5, 5, 10)
    for k in range(7):
        a.measure(f"place {k}", a.parts[1].point(k, 0, 0), along="z", limits=(-1e-4, 1e-4))
    a.measure("root 0", lambda poses: ca.sqrt(-poses.position(top)[2]), limits=(0, 1))
    program = compiled(a, solver="daqp")
    text = printed(tc.summarize(tc.run(program, samples=40, seed=1, surfaces=0)))[1]
    assert "root 0: not a number" in text and "2 more fall short, too" in text
    for k in range(1, 8):
        a.measure(f"root {k}", lambda poses: ca.sqrt(-poses.position(top)[2]), limits=(0, 1))
    text = printed(tc.summarize(tc.run(compiled(a, solver="daqp"), samples=40, seed=1, surfaces=0)))[1]
    assert "2 more not a number in some realizations, 7 more fall short, too" in text


@pytest.mark.parametrize("width", [100, 80])
def test_no_column_of_a_terminal_is_cut(width, tmp_path):
    """Means of many digits have their interval on two lines, so that the share out of specification stays in view."""
    text, line = printed(tc.summarize(tc.run(compiled(many_gaps()), samples=300, seed=1)), width)
    assert "specification" in text and max(map(len, text.splitlines())) <= width
    assert "54 %" in line and "[48," in line and "60]" in line


def test_many_parts_and_pairs_are_shortened_to_those_that_move_and_touch_most():
    summary = tc.summarize(tc.run(compiled(many_parts()), samples=40, seed=1, surfaces=0))
    (brief, line), (whole, _) = printed(summary), printed(summary, is_whole=True)
    assert "move most (6 sigma, mm): block 0" in line and line.count("8 more") == 2 and "7 more" in line
    assert "without contact, percentiles, all parts and pairs, other checks: the page has all" in line
    assert "block 7" not in brief and "under 8" not in brief
    assert all(f"{name} {k}" in whole for k in range(COUNT) for name in ("block", "under"))


def test_a_long_summary_fits_a_screen_and_names_what_failed():
    """Six measurements and eleven parts; the ninth block often lies in a post that it has no contact with."""
    a = many_parts()
    for k in range(5):
        a.measure(f"place {k}", a.parts[k + 1].point(0, 0, 0), along="z", limits=(-0.001, 0.001))
    a.part("post", tc.Box(5, 5, 40), at=(40 * (COUNT - 1) + 20.001, 12, 10.5), fixed=True)
    summary = tc.summarize(tc.run(compiled(a), samples=40, seed=1, surfaces=0))
    brief, line = printed(summary)
    assert len(brief.splitlines()) <= 50
    assert all(f"place {k}: does not meet its limits" in line for k in range(5)) and "status: " in line
    assert "parts without declared contact lie in each other: block 8 / post (" in line
    assert "but parts lie in each other in" in line
