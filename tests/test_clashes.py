"""Bodies without declared contact that lie in each other: checks name them, runs count them, and declarations permit them."""

import itertools
import json
import math
import re
import warnings
from io import StringIO

import numpy as np
import pytest
import trimesh
from rich.console import Console
from scipy.stats import norm

import tolcontact as tc
from tests.helpers import assembly_of, call, compiled, realizations
from tests.step_files import step_block
from tolcontact.report import summary_text
from tolcontact.testing import assert_no_clashes, assert_resolved

CLEARANCE, SIGMA = 0.05, 0.1  # mm
DRAWS = 128


def beside_wall(clearance=CLEARANCE, *, table=None, sigma=SIGMA) -> tc.Assembly:
    """A block on a table, `clearance` from a wall, of which it keeps a normal distance with standard deviation `sigma`."""
    a = tc.Assembly("nook", method=tc.Method(resolution="exact", objective="all points"))
    base = a.part("base", tc.Box(100, 60, 10) if table is None else table, fixed=True)
    if table is None:
        a.part("wall", tc.Box(10, 60, 30), at=(-10, 0, 10), fixed=True)
    block = a.part("block", tc.Box(50, 30, 20), at=(clearance, 15, 10))
    feet = [("A1", (5, 5, 0), "z"), ("A2", (45, 5, 0), "z"), ("A3", (25, 25, 0), "z"), ("B1", (5, 0, 10), "y")]
    locators = [tc.Locator(*foot, 0) for foot in [*feet, ("B2", (45, 0, 10), "y")]]
    a.locate(block, [*locators, tc.Locator("C", (50, 15, 10), "-x", 6 * sigma)])
    a.contact("seat", moving=block.face("-z"), reference=base.face("+z"))
    a.measure("x", block.point(0, 15, 10), along="x", limits=(-1, 1))
    return a


def angle_table() -> tc.Mesh:
    """Return a table with a wall, in one body."""
    legs = [trimesh.creation.box(bounds=bounds) for bounds in ([(0, 0, 0), (100, 60, 10)], [(-10, 0, 0), (0, 60, 40)])]
    return tc.Mesh(trimesh.boolean.union(legs))


def warned(assembly, **options) -> list[str]:
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        tc.build(assembly, **options)
    return [str(record.message) for record in records if record.category is tc.NominalWarning]


def printed(summary) -> str:
    """Return what the command line prints of a summary, in long lines."""
    console = Console(width=1000, file=StringIO(), highlight=False)
    console.print(summary_text(summary))
    return "\n".join(line.rstrip() for line in console.file.getvalue().splitlines())


def share_of(text: str) -> float:
    """Return the share of draws that a warning states."""
    return float(re.search(r"in ([\d.]+) % of 128 draws", text)[1]) / 100


@pytest.fixture(scope="module")
def results():
    return tc.run(compiled(beside_wall()), samples=2000, seed=1, surfaces=0)


def test_clashes_have_the_probability_of_the_normal_distribution(results):
    expected = norm.cdf(-CLEARANCE / SIGMA)
    estimate, lower, upper = tc.summarize(results)["clash_share"].values
    assert lower < expected < upper and abs(estimate - expected) < 4 * math.sqrt(expected * (1 - expected) / 2000)


def test_the_depth_of_a_clash_is_what_the_part_has_moved_beyond_the_clearance(results):
    depth = -CLEARANCE - results.measured.sel(state="corrected", measure="x").values
    clashing = results.clashes.values > 0
    allowed, usual = results.attrs["interference_depth"], 6 * SIGMA * 9 / 10_000
    assert allowed == pytest.approx(3 * 6 * SIGMA / 2000)  # the largest: the seat keeps its fixed planes
    assert clashing[depth > 1.01 * usual].all() and not clashing[depth < 0.99 * usual].any()
    np.testing.assert_allclose(results.clash_depth.values[clashing], depth[clashing], atol=1.1 * allowed)
    parts = [str(part) for part in results.part.values]
    pairs = {(parts[i], parts[j]) for i, j in zip(results.clash_part.values, results.clash_other.values, strict=True) if i >= 0}
    assert pairs == {("wall", "block")}
    assert (results.clash_depth.values[~clashing] == 0).all() and (results.clash_part.values[~clashing] == -1).all()


def test_the_summary_counts_clashes_by_parts(results):
    summary = tc.summarize(results)
    clashing = int((results.clashes.values > 0).sum())
    assert summary["clash"].values.tolist() == ["wall / block"] and summary["clash_count"].values.tolist() == [clashing]
    assert float(summary["clash_largest_depth"][0]) == results.clash_depth.values.max()
    assert int(summary["watched"]) == 2000 and not summary["clash_declared"].values.any()
    text = printed(summary)
    assert re.search(r"parts without declared contact lie in each other: 3\d\.\d % .* verdicts do not hold there", text)
    assert f"wall / block ({clashing:,}".replace(",", " ") in text.replace("\N{NARROW NO-BREAK SPACE}", " ").replace(",", " ")
    assert "interference of bodies from 0.0009 mm: see above (all 2 000 tested)" in text


def test_a_warning_names_the_faces_and_the_share():
    (text,) = warned(beside_wall())
    assert re.match(r'\[clash\] part "block" \(test_clashes\.py:\d+\): it lies in part "wall" in ', text)
    expected = norm.cdf(-CLEARANCE / SIGMA)
    assert abs(share_of(text) - expected) < 4 * math.sqrt(expected * (1 - expected) / DRAWS)
    assert 'assembly.contact("block on wall", moving=block.face("-x"), reference=wall.face("+x"))' in text
    assert "assembly.may_overlap(wall, block)" in text


@pytest.mark.parametrize("resolution", ["exact", "linearized"])
@pytest.mark.parametrize("clearance", [0.05, 0.8])
def test_only_what_tolerances_reach_is_named(resolution, clearance):
    texts = warned(beside_wall(clearance), method={"resolution": resolution})
    assert [text[:7] for text in texts] == ["[clash]"] * (clearance < 3 * SIGMA)


def test_the_suggested_contact_ends_the_clash():
    assembly = beside_wall()
    _, wall, block = assembly.parts
    assembly.contact("block on wall", moving=block.face("-x"), reference=wall.face("+x"))
    assert not warned(assembly)
    results = tc.run(compiled(assembly), samples=200, seed=1, surfaces=0)
    assert_no_clashes(results)
    assert_resolved(results)
    lines = printed(tc.summarize(results))
    assert "interference of bodies from 0.0009 mm: none where certified (all 200 tested)" in lines


def test_overlaps_that_are_meant_are_not_told(tmp_path):
    assembly = beside_wall()
    overlap = assembly.may_overlap(*assembly.parts[1:])
    assert str(overlap) == "overlap of wall, block" and not warned(assembly)
    path = tmp_path / "meant.nc"
    results = tc.run(compiled(assembly), samples=100, seed=1, surfaces=0, out=path)
    assert_no_clashes(results)
    assert results.attrs["not_watched"] == "overlaps that are declared: (wall, block)"
    results.close()
    with tc.open_archive(path) as archived:
        assert list(map(str, tc.io.model_of(archived).overlaps)) == ["overlap of wall, block"]


def test_overlaps_survive_json(tmp_path):
    assembly = beside_wall()
    assembly.may_overlap(*assembly.parts[1:])
    tc.io.write_model(assembly, tmp_path / "model.json")
    assert json.loads((tmp_path / "model.json").read_text())["overlaps"][0]["parts"] == ["wall", "block"]
    assert list(map(str, assembly_of(tmp_path / "model.json").overlaps)) == ["overlap of wall, block"]


def test_models_without_overlaps_have_no_entry_of_them(tmp_path):
    assembly = beside_wall(0.8)
    tc.io.write_model(assembly, tmp_path / "model.json")
    assert "overlaps" not in json.loads((tmp_path / "model.json").read_text())


@pytest.mark.parametrize("parts", [0, 1, 2])
def test_an_overlap_needs_two_parts_of_the_assembly(parts):
    assembly, other = beside_wall(), tc.Assembly("other")
    assembly.may_overlap(*[other.part(f"part {k}", tc.Box(1, 1, 1)) for k in range(parts)])
    faults = " ".join(tc.check(assembly))
    assert ("it names" in faults) == (parts < 2) and ('unknown part "part 0"' in faults) == (parts > 0)
    with pytest.raises(TypeError, match="expected parts, as in may_overlap"):
        assembly.may_overlap("wall", "block")


def test_a_nominal_overlap_is_told_once():
    (text,) = warned(beside_wall(-1.0, sigma=0.02))
    assert text.startswith("[overlap]")
    assembly = beside_wall(-1.0, sigma=0.02)
    assembly.may_overlap(*assembly.parts[1:])
    assert not warned(assembly)


def test_faces_that_were_not_chosen_are_named():
    """The seat is declared; the wall, which belongs to the same body, is not."""
    (text,) = warned(beside_wall(table=angle_table()))
    assert re.match(r'\[clash\] contact pair "seat" .*part "block" still lies in part "base" beyond the chosen faces', text)
    assert 'moving=block.face("-x"), reference=base.face("+x")' in text


def test_a_block_that_sinks_into_its_base_on_springs_is_named_without_a_pair():
    a = tc.Assembly("press", method=tc.Method(objective="seating"))
    base, block = a.part("base", tc.Box(40, 40, 10), fixed=True), a.part("block", tc.Box(20, 20, 10), at=(10, 10, 10))
    feet = [
        tc.Locator(f"A{k}", p, "z", one_sided=True, stiffness=1000) for k, p in enumerate([(2, 2, 0), (18, 2, 0), (10, 18, 0)])
    ]
    sides = [tc.Locator("B1", (2, 0, 5), "y"), tc.Locator("B2", (18, 0, 5), "y"), tc.Locator("C", (0, 10, 5), "x")]
    a.locate(block, [*feet, *sides], tolerance=0.01, on=base)
    a.force("press", at=block.point(10, 10, 10), vector=(0, 0, -300))
    a.measure("height", block.point(10, 10, 10), along="z")
    (text,) = warned(a)
    assert re.match(r'\[clash\] part "block" .*part "block" still lies in part "base" beyond the supports in all', text)


def test_answers_beyond_the_chosen_faces_are_doubtful_and_say_why():
    results = tc.run(compiled(beside_wall(table=angle_table())), samples=200, seed=1, surfaces=0)
    depth = -CLEARANCE - results.measured.sel(state="corrected", measure="x").values
    doubtful = results.status.values == tc.Status.DOUBTFUL
    allowed = results.attrs["interference_depth"]
    assert doubtful[depth > 1.01 * allowed].all() and not doubtful[depth < 0.99 * allowed].any()
    assert (results.clashes.values == 0).all() and (results.clash_part.values[doubtful] == 0).all()
    lines = printed(tc.summarize(results))
    assert f"in {doubtful.sum()} of 200 answers bodies with declared contact still lie in each other: base / block" in lines
    with pytest.raises(AssertionError, match="doubtful"):
        assert_resolved(results)


def test_a_second_pair_at_the_wall_ends_the_doubt():
    assembly = beside_wall(table=angle_table())
    base, block = assembly.parts
    face = base.face("+x", tc.select.Inside((-1, -1, 10), (1, 61, 41)))
    assembly.contact("wall", moving=block.face("-x"), reference=face)
    assert not warned(assembly)
    assert_resolved(realizations(compiled(assembly), samples=200, seed=1))


def test_linearized_runs_say_that_bodies_were_not_tested():
    results = tc.run(compiled(beside_wall(), method={"resolution": "linearized"}), samples=50, seed=1, surfaces=0)
    summary = tc.summarize(results)
    assert int(summary["watched"]) == 0 and math.isnan(summary["clash_share"].values[0])
    assert "\n  bodies were not tested for interference by a lin" in printed(summary)
    with pytest.raises(AssertionError, match="bodies were not tested in 50"):
        assert_no_clashes(results)


def test_assert_no_clashes_names_the_first_one(results):
    with pytest.raises(AssertionError, match=r'parts lie in each other in .* realizations, first "wall" and "block"'):
        assert_no_clashes(results)


def test_stations_are_named_in_the_suggested_line():
    a = beside_wall()
    line = tc.Assembly("line", method=a.method)
    wall = line.part("wall", tc.Box(10, 60, 30), at=(-10, 0, 0), fixed=True)
    block = line.part("block", tc.Box(50, 30, 20), at=(CLEARANCE, 15, 0))
    weld = line.station("weld on")
    weld.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("+x")), tolerance=6 * SIGMA)
    weld.measure("x", tc.Gap(block.point(0, 15, 10), wall.face("+x")), limits=(-1, 1))
    (text,) = warned(line)
    assert 'weld_on.contact("block on wall", moving=block.face("-x"), reference=wall.face("+x"))' in text


def test_the_command_states_clashes(tmp_path):
    (tmp_path / "nook.py").write_text("from tests.test_clashes import beside_wall as assembly\n", encoding="utf-8")
    done = call(tmp_path, "check", "nook.py")
    assert "[clash] part" in " ".join((done.stdout + done.stderr).split())
    done = call(tmp_path, "run", "nook.py", "--samples", "200", "--out", "nook.nc")
    assert "; but parts lie in each other in" in " ".join(done.stdout.split())
    done = call(tmp_path, "summary", "nook.nc", "--json")
    summary = json.loads(done.stdout)
    variables = summary["data_vars"]
    assert summary["coords"]["clash"]["data"] == ["wall / block"] and variables["watched"]["data"] == 200
    estimate, lower, upper = variables["clash_share"]["data"]
    assert lower < estimate < upper


def test_pairs_of_parts_are_combined_once():
    """Any two parts of one overlap may lie in each other, in every order."""
    assembly = beside_wall()
    assembly.may_overlap(*reversed(assembly.parts))
    allowed = compiled(assembly).watch.allowed
    assert all(allowed[pair] == math.inf for pair in itertools.combinations(range(3), 2))


def test_the_suggested_line_chooses_faces_of_step_files_that_end_the_clash(tmp_path):
    (tmp_path / "block.step").write_text(step_block())  # of 10 x 20 x 30
    shape, added = tc.Mesh(tmp_path / "block.step"), list[str]()

    def nook() -> tc.Assembly:
        assembly = tc.Assembly("nook", method=tc.Method(resolution="exact", objective="all points"))
        base, wall = (
            assembly.part("base", tc.Box(100, 60, 10), fixed=True),
            assembly.part("wall", shape, at=(0, 0, 10), fixed=True),
        )
        block = assembly.part("block", shape, at=(10 + CLEARANCE, 0, 10))
        feet = [("A1", (2, 2, 0), "z"), ("A2", (8, 2, 0), "z"), ("A3", (5, 18, 0), "z"), ("B1", (2, 0, 9), "y")]
        locators = [tc.Locator(*foot, 0) for foot in [*feet, ("B2", (8, 0, 9), "y")]]
        assembly.locate(block, [*locators, tc.Locator("C", (10, 10, 15), "-x", 6 * SIGMA)])
        assembly.contact("seat", moving=block.face("-z"), reference=base.face("+z"))
        assembly.measure("x", block.point(0, 10, 15), along="x", limits=(-1, 1))
        for line in added:
            exec(line, {"tc": tc, "assembly": assembly, "wall": wall, "block": block})
        return assembly

    (text,) = warned(nook())
    added.append(re.search(r"assembly\.contact\(.*\)(?=, or say)", text)[0])
    assert added[0].count("tc.select.Brep(") == 2
    assert not warned(nook())
    assert_no_clashes(tc.run(compiled(nook()), samples=200, seed=1, surfaces=0))
