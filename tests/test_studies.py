"""Each script of `studies/` runs, at a small size."""

import importlib.util
import shutil
import sys

import pytest

from tests.helpers import ROOT, run

STUDIES = {
    "benchmarks/others.py": ["two_causes", "ishigami"],
    "benchmarks/pages.py": ["pages"],
    "benchmarks/references.py": ["linear_stack"],
    "benchmarks/run.py": ["linear_stack"],
    "bodies/measure.py": ["--scenes", "ring", "--sizes", "3", "--methods", "linearized", "--figure", "cost.png"],
    "cad/as1.py": ["--samples", "20"],
    "cad/as1_nine.py": ["--samples", "20", "--surfaces", "2"],
    "cad/compare_numbers.py": [ROOT / "studies" / "cad" / "as1-oc-214.stp"],
    "cad/pmi_fixture.py": [ROOT / "studies" / "cad"],
    "cad/pmi_parts.py": [ROOT / "studies" / "cad"],
    "cad/pmi_readings.py": [ROOT / "studies" / "cad"],
    "cad/read_files.py": [ROOT / "studies" / "cad"],
    "cad/trimmed_faces.py": [ROOT / "models" / "cover.step"],
    "certificates/coincidences.py": ["--scenes", "6", "--samples", "3"],
    "certificates/ends.py": ["--scenes", "6", "--samples", "3"],
    "certificates/judge.py": ["--scenes", "3", "--samples", "20"],
    "exact/tables.py": ["--samples", "20"],
    "form/measure.py": ["--samples", "10", "--figure", "gaps.png"],
    "objectives/measure.py": ["--samples", "20", "--models", "ra1", "lid", "--to", "."],
    "paper/reproduce.py": ["--large", "2000", "--to", "."],
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
    "round/measure.py": ["20"],
    "scale/scale.py": ["--samples", "20000", "--kills", "2"],
    "site/build.py": ["site", "--samples", "20"],
    "solvers/measure.py": ["--realizations", "2", "--figure", "accuracy.png"],
    "speed/measure.py": ["--quick", "--figure", "cost.png"],
    "speed/springs.py": ["20"],
    "verification/intervals.py": ["--repeats", "3", "--sizes", "100"],
    "verification/rare.py": ["--seeds", "1", "--samples", "4000", "--only", "two ways", "does not fit"],
}
EXTRAS = {
    "benchmarks/others.py": ["openturns", "otaf", "SALib"],
    "solvers/measure.py": ["qpsolvers"],
    "speed/measure.py": ["qpsolvers", "daqp"],
    "report/picture.py": ["playwright"],
    "site/build.py": ["sphinx", "myst_parser", "furo"],
}


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


@pytest.mark.nightly
@pytest.mark.parametrize("name", STUDIES)
def test_a_study_runs(name, tmp_path):
    if missing := [module for module in EXTRAS.get(name, ()) if importlib.util.find_spec(module) is None]:
        pytest.skip(f"{', '.join(missing)} is not installed")
    if name == "report/picture.py" and shutil.which("chromium") is None:
        pytest.skip("there is no Chromium")
    done = run([sys.executable, ROOT / "studies" / name, *map(str, STUDIES[name])], cwd=tmp_path, timeout=1800)
    assert done.returncode == 0, done.stderr
