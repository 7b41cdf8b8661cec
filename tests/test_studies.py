"""Each script of `studies/` runs, at a small size."""

import importlib.util
import re
import shutil
import sys
from pathlib import Path

import pytest

from studies.cost import measure
from studies.tables import markdown, tables
from tests.helpers import ROOT, run

STUDIES = {
    "benchmarks/others.py": ["two_causes", "ishigami"],
    "benchmarks/pages.py": ["pages"],
    "benchmarks/references.py": ["linear_stack"],
    "benchmarks/run.py": ["linear_stack"],
    "cad/as1.py": ["--samples", "100", "--to", "."],
    "cad/as1_nine.py": ["--samples", "20", "--surfaces", "2"],
    "cad/compare_numbers.py": [ROOT / "studies" / "cad" / "as1-oc-214.stp"],
    "cad/pmi_fixture.py": [ROOT / "studies" / "cad"],
    "cad/pmi_parts.py": [ROOT / "studies" / "cad"],
    "cad/pmi_readings.py": [ROOT / "studies" / "cad"],
    "cad/read_files.py": [ROOT / "studies" / "cad"],
    "cad/trimmed_faces.py": [ROOT / "models" / "cover.step"],
    "certificates/coincidences.py": ["--scenes", "6", "--samples", "3"],
    "certificates/ends.py": ["--scenes", "6", "--samples", "3"],
    "certificates/frames.py": ["a pattern"],
    "certificates/judge.py": ["--scenes", "3", "--samples", "20"],
    "certificates/optima.py": ["--first", "6000", "--scenes", "2", "--samples", "3", "--starts", "1"],
    "cost/cluster.py": ["--samples", "20000", "--to", "."],
    "cost/measure.py": ["--scenes", "ra1", "ring", "--sizes", "3", "--seconds", "0.01", "--to", "."],
    "drawings/rules.py": ["--to", "."],
    "drawings/six.py": ["--samples", "40", "--to", "."],
    "elastic/measure.py": ["--realizations", "5", "--rows", "38", "--sheets", "83", "--draws", "1", "--to", "."],
    "elastic/set_up.py": ["38"],
    "exact/tables.py": ["--samples", "300", "--to", "."],
    "form/measure.py": ["--samples", "20", "--to", "."],
    "objectives/measure.py": ["--samples", "20", "--models", "ra1", "lid", "--to", "."],
    "paper/reproduce.py": ["--large", "20000", "--to", "."],
    "pictures/contact.py": ["contact.svg"],
    "pictures/cover_pmi.py": ["cover_pmi.stp"],
    "pictures/draw.py": ["pictures"],
    "report/picture.py": ["ra1.png"],
    "robustness/files.py": ["--archives", "1", "--shapes", "2", "--models", "2", "--steps", "2", "--hostile-steps", "2"],
    "robustness/formats.py": ["--spreadsheets", "1", "--scans", "2"],
    "robustness/machines.py": ["--only", "environments", "--first", "2"],
    "robustness/processes.py": ["--killed", "1", "--writers", "1", "--stations", "1"],
    "robustness/scripts.py": ["--names", "1", "--pmi", "1", "--functions", "2"],
    "robustness/signals.py": ["--tries", "3"],
    "round/measure.py": ["--samples", "100", "--to", "."],
    "site/build.py": ["site", "--samples", "20"],
    "solvers/draws.py": ["--models", "ra1", "--turns", "1", "--draws", "20", "--references", "2", "--to", "."],
    "solvers/problems.py": ["--realizations", "2", "--to", "."],
    "verification/intervals.py": ["--repeats", "3", "--sizes", "100"],
    "verification/parts.py": ["--repetitions", "2", "--samples", "200"],
    "verification/rare.py": ["--seeds", "1", "--samples", "30000", "--only", "two ways", "does not fit"],
}
UNCOMPARED = (  # times, solvers of other packages, fewer draws
    *(
        "cluster.py: cluster",
        "measure.py: cost",
        "measure.py: set_up",
        "measure.py: whole",
        "draws.py: draws",
        "draws.py: search",
        "problems.py: problems",
    ),
)
EXTRAS = {
    "elastic/measure.py": ["ngsolve"],
    "elastic/set_up.py": ["ngsolve"],
    "benchmarks/others.py": ["openturns", "otaf", "SALib"],
    "solvers/problems.py": ["qpsolvers"],
    "report/picture.py": ["playwright"],
    "site/build.py": ["sphinx", "myst_parser", "furo"],
}


INTERVAL = re.compile(r"\[(-?[\d.]+|-?inf), (-?[\d.]+|-?inf)\]")
NUMBER = re.compile(r"(?:below )?[-+]?\d\S*.*")


def rows_by_label(table):
    """Return the header, and the cells of each row by its leading texts."""
    header, _, *rows = ([cell.strip() for cell in line.strip("|").split("|")] for line in table.splitlines())
    labels = [next((k for k, cell in enumerate(row) if NUMBER.fullmatch(cell)), len(row)) for row in rows]
    return header, {tuple(row[: max(count, 1)]): row[max(count, 1) :] for row, count in zip(rows, labels, strict=True)}


def contradictions(stated, written):
    """Return what differs between two tables: headers, rows, and intervals that do not overlap."""
    (header, rows), (other_header, other_rows) = rows_by_label(stated), rows_by_label(written)
    differences = [] if header == other_header else [f"{other_header} in place of {header}"]
    for label, cells in other_rows.items():
        if label not in rows or len(rows[label]) != len(cells):
            differences.append(f"no such row: {label}")
            continue
        for expected, actual in zip(rows[label], cells, strict=True):
            intervals = [INTERVAL.search(cell) for cell in (expected, actual)]
            if all(intervals):
                (lower, upper), (other_lower, other_upper) = ([float(bound) for bound in match.groups()] for match in intervals)
                is_equal = lower <= other_upper and other_lower <= upper
            elif expected.startswith("below ") and actual.startswith("below "):
                is_equal = float(actual[6:]) <= float(expected[6:])
            else:
                are_estimates = NUMBER.fullmatch(expected) and NUMBER.fullmatch(actual) and not (expected + actual).isdigit()
                is_equal = bool(are_estimates) or expected == actual
            if not is_equal:
                differences.append(f"{label}: {actual} in place of {expected}")
    return differences


def test_a_table_contradicts_another_row_interval_or_verdict():
    table = "| case | points | mean | verdict |\n|---|---|---|---|\n| peg | 12 | 0.3 [0.2, 0.4] | agrees |\n"
    assert not contradictions(table, table.replace("0.3 [0.2, 0.4]", "0.35 [0.1, 0.6]"))
    for text, other in (("[0.2, 0.4]", "[0.5, 0.6]"), ("agrees", "differs"), ("peg", "pin"), ("mean", "median"), ("12", "13")):
        assert len(contradictions(table, table.replace(text, other))) == 1


def test_no_script_is_forgotten():
    scripts = (ROOT / "studies").glob("*/*.py")
    assert {str(path.relative_to(ROOT / "studies")) for path in scripts if "__main__" in path.read_text()} == set(STUDIES)


def test_pictures_of_the_guide_are_those_of_their_scripts(tmp_path):
    guide = ROOT / "tolcontact" / "guide"
    for script, arguments, folder in (("draw", [tmp_path], "pictures"), ("cover_pmi", [tmp_path / "cover_pmi.stp"], "files")):
        done = run([sys.executable, ROOT / "studies" / "pictures" / f"{script}.py", *arguments], cwd=tmp_path, timeout=60)
        assert done.returncode == 0, done.stderr
        for file in (guide / folder).iterdir():
            assert (tmp_path / file.name).read_text() == file.read_text(), file.name


def test_the_table_of_costs_has_the_figures_of_its_csv_file():
    text = markdown(measure.table(measure.read(measure.HERE / "cost.csv")))
    assert tables(measure.HERE / "README.md")["measure.py: cost"] == text


def corner_heights():
    """Return mean corner heights of RA1 with their bounds, by objective, from the study of objectives (exact resolution)."""
    _, rows = rows_by_label(tables(ROOT / "studies" / "objectives" / "README.md")["measure.py: objectives"])
    means = {label[1]: cells[0] for label, cells in rows.items() if label[0] == "ra1, exact: corner height"}
    return {name: [float(number) for number in re.findall(r"-?[\d.]+", mean)] for name, mean in means.items()}


def test_the_readme_states_the_corner_heights_of_the_study():
    limits = (ROOT / "README.md").read_text(encoding="utf-8").partition("\n## Limits\n")[2].partition("\n## ")[0]
    heights = corner_heights()
    for name, text in (
        ("active points", r'([\d.]+) mm by the paper\'s\s+"active points"'), ("all points", r'([\d.]+) by "all points"'),
        ("locator stiffness", r'([\d.]+) by "all points" \(default\) and by springs'), ("seating", r"([\d.]+) under a weight"),
    ):  # fmt: skip
        (stated,) = re.findall(text, limits)
        mean, lower, upper = heights[name]
        assert lower < float(stated) < upper and abs(float(stated) - mean) < 0.01


@pytest.mark.slow
def test_the_summary_of_ra1_states_corner_heights_that_agree_with_the_study():
    done = run(
        [sys.executable, "-m", "tolcontact", "run", ROOT / "models" / "ra1.py", "--resolution", "exact", "--solver", "daqp",
         "--seed", "1", "--samples", "1000", "--fields", "none", "--surfaces", "0"], cwd=ROOT, timeout=600,
    )  # fmt: skip
    (line,) = [line for line in done.stdout.splitlines() if "corner height: mean" in line]
    others = re.findall(r'\[([\d.]+), ([\d.]+)\] by "([^"]+)"', line)
    assert {name for *_, name in others} == {"all points", "locator stiffness"}
    for lower, upper, name in others:
        assert float(lower) < corner_heights()[name][0] < float(upper)


@pytest.mark.nightly
@pytest.mark.parametrize("name", STUDIES)
def test_a_study_runs(name, tmp_path):
    if missing := [module for module in EXTRAS.get(name, ()) if importlib.util.find_spec(module) is None]:
        pytest.skip(f"{', '.join(missing)} is not installed")
    if name == "report/picture.py" and shutil.which("chromium") is None:
        pytest.skip("there is no Chromium")
    done = run([sys.executable, ROOT / "studies" / name, *map(str, STUDIES[name])], cwd=tmp_path, timeout=1800)
    assert done.returncode == 0, done.stderr
    if (page := tmp_path / "README.md").exists():
        stated = tables((ROOT / "studies" / name).with_name("README.md"))
        compared = {mark: text for mark, text in tables(page).items() if mark.startswith(Path(name).name + ":")}
        assert compared
        for mark, text in compared.items():
            assert mark in UNCOMPARED or not contradictions(stated[mark], text), mark
