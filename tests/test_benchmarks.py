"""The benchmark suite: expected values in two ways, answers of tolcontact, pages."""

import re
import sys
from dataclasses import replace

import pytest
from rich.console import Console

from studies.benchmarks import pages, run as benchmarks
from studies.benchmarks.answers import Estimate
from studies.benchmarks.drawing import svg
from studies.benchmarks.problem import FOLDER, names, problems, read
from tests.helpers import nightly, run

QUICK = (
    "beam_on_three_pegs", "beam_on_three_supports", "block_on_plane", "clutch_percentages", "hole_at_maximum_material",
    "ishigami", "linear_stack", "rectangular_pocket", "shaft_in_v", "worst_clutch",
)  # fmt: skip
MESHED = ("beam_on_three_supports", "heavy_beam", "heavy_strip", "low_middle_support")  # by the extra `elastic`
REFERENCES = [sys.executable, "-m", "studies.benchmarks.references"]


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::tolcontact.errors.NominalWarning")
@pytest.mark.parametrize("name", [*QUICK, *nightly(*(name for name in names() if name not in QUICK))])
def test_expected_values_are_computed(name):
    if name in MESHED:
        pytest.importorskip("ngsolve")
    problem = read(name)
    verdicts = {figure.verdict for figure in benchmarks.solved(problem).figures}
    assert verdicts == {benchmarks.UNSUPPORTED if problem.unsupported else benchmarks.AGREES}


@pytest.mark.slow
@pytest.mark.parametrize("chosen", [QUICK, pytest.param((), marks=pytest.mark.nightly)], ids=["quick", "all"])
def test_two_ways_without_the_package_confirm_expected_values(chosen):
    done = run([*REFERENCES, *chosen])
    assert done.returncode == 0 and "WRONG" not in done.stdout, done.stdout
    assert done.stdout.count("ok ") >= sum(len(problem.quantities) for problem in problems(chosen))


def test_a_wrong_value_is_an_exit_code():
    problem = read("worst_clutch")
    assert benchmarks.report([benchmarks.solved(problem)], Console(quiet=True)) == 0
    least, largest = problem.quantities
    wrong = replace(problem, quantities=(least, replace(largest, expected=largest.expected + 1e-4)))
    assert benchmarks.report([benchmarks.solved(wrong)], Console(quiet=True)) == 1


def test_an_interval_wider_than_a_factor_of_two_is_no_agreement():
    (probability,) = read("forty_parts").quantities
    figures = [
        benchmarks.Figure(probability, Estimate(probability.expected, probability.expected / wide, probability.expected * wide))
        for wide in (1.4, 1.45, 30.0)
    ]
    assert [figure.verdict for figure in figures] == [benchmarks.AGREES, benchmarks.TOO_WIDE, benchmarks.TOO_WIDE]


def test_the_table_of_the_readme_has_every_problem_with_a_whole_interval_around_what_is_expected():
    rows = benchmarks.rows()
    for problem in problems():
        _, _, expected, computed, interval, verdict, *_ = [cell.strip() for cell in rows[problem.name].split("|")[1:-1]]
        assert float(expected) == pytest.approx(problem.quantities[0].expected, rel=1e-5, abs=1e-12), problem.name
        assert verdict == (benchmarks.UNSUPPORTED if problem.unsupported else benchmarks.AGREES), problem.name
        if not problem.unsupported and " to " in interval:
            lower, upper = map(float, interval.split(" to "))
            assert lower <= float(computed) <= upper, problem.name


@pytest.mark.nightly
@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::tolcontact.errors.NominalWarning")
@pytest.mark.parametrize("name", QUICK)
def test_the_table_of_the_readme_is_what_its_script_writes(name):
    if name in MESHED:
        pytest.importorskip("ngsolve")
    written = benchmarks.row(benchmarks.solved(read(name)))
    assert benchmarks.rows()[name].split("|")[:7] == written.split("|")[:7]


def test_an_unknown_problem_is_named():
    with pytest.raises(ValueError, match="no problem is named clutsch"):
        problems(["clutsch"])


def test_problems_are_pairs_of_files():
    files = sorted(path.name for path in FOLDER.iterdir() if path.is_file())
    assert files == sorted(f"{name}{suffix}" for name in names() for suffix in (".json", ".py"))


def test_each_problem_has_a_page(tmp_path):
    pages.write(tmp_path, problems())
    index = (tmp_path / "index.html").read_text()
    assert sorted(re.findall(r'href="(\w+)\.html"', index)) == sorted(names())
    for name in names():
        page = (tmp_path / f"{name}.html").read_text()
        assert "<svg" in page and "def solution()" in page and "{" not in read(name).text, name


def test_a_shape_that_is_none_is_named():
    with pytest.raises(ValueError, match="blob 1 2"):
        svg(("box 0 0 1 1", "blob 1 2"))


def test_the_suite_is_large_and_most_of_it_is_solved():
    supported = [problem for problem in problems() if not problem.unsupported]
    assert len(problems()) >= 65 and len(supported) >= 60 and len(QUICK) == 10
