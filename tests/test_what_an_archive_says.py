"""What stands in an archive beside its rows: settings, models, contacts, samples, and which rows were looked at again."""

import json
import time

import netCDF4
import numpy as np
import pytest
import trimesh
import xarray as xr
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import PAPER, compiled, joined, simulate
from tolcontact.errors import ArchiveError

SEATED = {"resolution": "exact", "objective": "seating"}


@pytest.fixture(scope="module")
def archive(tmp_path_factory):
    path = tmp_path_factory.mktemp("archive") / "stack.nc"
    tc.run(cases.stack(), samples=300, seed=3, solver="daqp", method=PAPER, out=path, surfaces=12).close()
    return path


def checked(tree):
    return tree["surface"].to_dataset()["realization_checked"].values.tolist()


def test_a_third_of_the_checked_rows_are_the_deepest_and_a_third_those_with_most_carrying_points(archive):
    root = xr.load_dataset(archive)
    certified = np.isin(root.status.values, [tc.Status.UNTOUCHED, tc.Status.RESOLVED])
    rows = checked(xr.load_datatree(archive))
    assert len(rows) == 12 and rows == sorted(set(rows)) and certified[rows].all()
    inside = np.where(certified, -root.gap_min.sel(state="corrected").values.min(axis=1), -1)
    carrying = np.where(certified, root.carrying.values.sum(axis=1), -1)
    deepest, busiest = (np.argsort(-values, kind="stable")[:4] for values in (inside, carrying))
    assert (inside[deepest] > 1e-9).all()
    assert {*deepest, *busiest} < set(rows)


@pytest.mark.slow
def test_the_other_checked_rows_are_drawn(archive):
    """Without penetration and with few carrying points nothing is special: what is drawn depends on the seed."""
    stack = compiled(cases.stack(), solver="daqp", method=PAPER)
    runs = [tc.run(stack, samples=300, seed=seed, surfaces=12) for seed in (3, 4)]
    assert checked(runs[0]) == checked(xr.load_datatree(archive)) != checked(runs[1])
    program = compiled(cases.stack(), solver="daqp")
    assert checked(tc.run(program, samples=5, surfaces=12)) == [*range(5), *[-1] * 7]
    assert checked(tc.run(program, samples=5, surfaces=0)) == []


def test_rows_that_are_not_certified_are_not_checked():
    """A block that its locators hold in a wall, but for few realizations."""
    tree = tc.run(compiled(cases.block_on_six(0.2), solver="daqp", method=SEATED), samples=60, surfaces=60)
    certified = np.flatnonzero(np.isin(tree["status"].values, [tc.Status.UNTOUCHED, tc.Status.RESOLVED]))
    assert 2 < len(certified) < 30
    rows = checked(tree)
    assert rows[: len(certified)] == certified.tolist() and set(rows[len(certified) :]) == {-1}
    surface = tree["surface"].to_dataset()
    assert np.isnan(surface["surface_penetration"].values[len(certified) :]).all()
    assert (surface["surface_penetration"].values[: len(certified)] < 1e-6).all()


def test_the_settings_of_a_run_are_its_attributes(archive):
    said = xr.load_dataset(archive).attrs
    expected = {
        "solver": "daqp", "resolution": "linearized", "objective": "active points", "weighting": "active points",
        "regularization": "points", "active_set": "closed", "search": "fixed",
        "method_from": "options", "seed": 3, "samples": 300, "kept": "all", "solver_accuracy": 1e-8,
        "title": "variation simulation of stack",
    }  # fmt: skip
    assert {word: said[word] for word in expected} == expected
    assert json.loads(said["solver_options"]) and said["solver_second"] == "qpoases, piqp"
    assert f"tolcontact {tc.__version__}" in said["versions"] and said["history"].endswith("created")


@pytest.mark.slow
def test_the_weighting_is_that_of_points_where_points_count():
    for objective, weighting, units in (
        ("all points", "all points, as opposite faces by their moments", "mm"),
        ("locator stiffness", "none", "N"),
    ):
        found = tc.run(compiled(cases.stack(), solver="daqp", method={"objective": objective}), samples=5)
        assert found.attrs["weighting"] == weighting and found["reaction"].attrs["units"] == units


@pytest.mark.slow
@pytest.mark.parametrize("model", [cases.ra1, cases.stack, cases.peg_in_a_hole])
def test_the_moments_of_faces_give_the_objective(tmp_path, model):
    """The mean square displacement of faces follows from the file alone, and is the objective that was minimized."""
    program = compiled(model(), solver="daqp", method=tc.Method())
    tc.run(program, samples=5, seed=3, out=tmp_path / "run.nc", surfaces=4).close()
    with xr.open_datatree(tmp_path / "run.nc") as tree:
        contact, R, t = tree["contact"], tree["rotation"].values, tree["translation"].values
        value, total = 0.0, 0.0
        for pair in range(contact.sizes["pair"]):
            for side, part in enumerate((int(contact.moving_part[pair]), int(contact.reference_part[pair]))):
                area, centre = float(contact.objective_area[pair, side]), contact.objective_centre[pair, side].values
                turn, shift = (values[:, 1, part] - values[:, 0, part] for values in (R, t))
                mean = turn @ centre + shift
                spread = np.einsum("nij,jk,nik->n", turn, contact.objective_moment[pair, side].values, turn)
                value, total = value + area * ((mean**2).sum(axis=1) + spread) / 2, total + area
    (group,) = program.groups
    block = joined(tc.simulate_blocks(program, samples=5, seed=3))
    supports = [program.nominal.pairs[group.group.pairs[side.pair]].is_supports for side in group.group.sides]
    moments = np.array([np.zeros(10) if zero else side.moments for zero, side in zip(supports, group.group.sides, strict=True)])
    raw, poses = (block["poses"][:, state][:, list(group.group.parts)] for state in (0, 1))
    inputs = {"raw": raw, "moments": np.tile(moments, (5, 1, 1)), "deviations": block["deviations"]}
    energy = group.solve.energy(poses=poses, **inputs)
    np.testing.assert_allclose(value / total, energy, rtol=1e-4, atol=1e-12)  # but for the regularization


def test_units_of_measures():
    a = cases.one_dimensional(6)
    block = a.parts[1]
    alone = tc.run(compiled(a, solver="daqp"), samples=5)
    assert alone["measured"].attrs["units"] == "mm"
    a.measure("tilt", lambda poses: poses.rotation(block)[2, 0], units="rad")
    mixed = tc.run(compiled(a, solver="daqp"), samples=5)
    assert mixed["measured"].attrs["units"] == "1" and mixed["measure_units"].values.tolist() == ["mm", "rad"]
    assert np.isnan(mixed["measure_tolerance"].values).all()
    turned = tc.Assembly("turned")
    only = turned.part("only", tc.Box(10, 10, 10))
    turned.locate(only, tc.three_two_one(only.face("-z"), only.face("-y"), only.face("-x"), inset=1), tolerance=0.1)
    turned.measure("tilt", lambda poses: poses.rotation(only)[2, 0], units="rad")
    assert tc.run(compiled(turned), samples=5)["measured"].attrs["units"] == "rad"


def test_units_of_contributors_and_limits(tmp_path):
    """Whoever reads the file alone gets deviations and limits in the units that stand beside them."""
    a = tc.Stack("motor", units="in")
    a.link("shaft", 1.5, 0.002)
    a.gap("length", limits=(1.4, 1.6))
    named = of_contributors, of_measures = (
        ("deviation", "tolerance_range", "mean_shift"),
        ("measured", "measure_nominal", "measure_tolerance", "measure_lower_limit", "measure_upper_limit", "measure_accuracy"),
    )
    tc.run(compiled(a), samples=5, out=tmp_path / "run.nc").close()
    with xr.open_datatree(tmp_path / "run.nc") as tree:
        for group, names in zip(("sample", ""), named, strict=True):
            assert {tree[f"{group}/{name}"].attrs["units"] for name in names} == {"in"}
    worst = tc.analyses.worst_case(a, samples=16)
    assert "units" not in worst["measured"].attrs and worst["measure_units"].values.tolist() == ["in"]
    a.variable("heat", 4, units="K", nominal=20)
    mixed = tc.run(compiled(a), samples=5)
    assert {mixed[f"sample/{name}"].attrs["units"] for name in of_contributors} == {"1"}
    assert mixed["sample/contributor_units"].values.tolist() == ["in", "K"]
    assert {mixed[name].attrs["units"] for name in of_measures} == {"in"}
    assert tc.simulate(a, 5)["deviation"].attrs["units"] == "1"


def test_the_sample_names_every_locator_with_its_tolerance_and_stiffness():
    tree = tc.run(compiled(cases.stopped(), solver="daqp"), samples=10)
    sample = tree["sample"].to_dataset()
    assert sample["locator"].values.tolist() == [f"block.{name}" for name in ("Z1", "Z2", "Z3", "Y1", "Y2", "X", "stop 0")]
    assert (sample["tolerance_range"].values == 1).all() and set(sample["distribution"].values) == {"normal"}
    assert sample["one_sided"].values.tolist() == [0] * 6 + [1]
    places = [(5, 5, 0), (45, 5, 0), (25, 25, 0), (5, 0, 10), (45, 0, 10), (0, 15, 10), (0, 5, 5)]
    assert (sample["locator_point"].values == places).all()
    assert sample["locator_direction"].values.tolist() == [[0, 0, 1.0]] * 3 + [[0, 1.0, 0]] * 2 + [[1.0, 0, 0]] * 2
    assert (sample["stiffness"].values == 1).all()
    contact = tree["contact"].to_dataset()
    assert contact["reference_part"].values.tolist() == [-1] and contact["locator_of_point"].values.tolist() == [6]


def test_a_distribution_of_ones_own_is_named():
    a = tc.Assembly("own")
    block = a.part("block", tc.Box(10, 10, 10), fixed=True)
    a.locate(block, [tc.Locator("Z", (5, 5, 0), "z", stats.gamma(2, scale=0.1)), *cases.translating(0)[1:]])
    a.measure("height", block.point(0, 0, 10), along="z")
    sample = tc.run(compiled(a, solver="daqp"), samples=5)["sample"].to_dataset()
    assert sample["distribution"].values.tolist()[0] == "gamma" and np.isnan(sample["tolerance_range"].values[0])


def test_means_of_contributors_are_those_of_their_distributions():
    a = tc.Assembly("off")
    block = a.part("block", tc.Box(10, 10, 10), fixed=True)
    z = [
        tc.Locator("Z", (5, 5, 0), "z", stats.gamma(2, loc=-0.1, scale=0.1)),
        *cases.translating(tc.Tolerance(0.2, shift=0.03))[1:],
    ]
    a.locate(block, z)
    block.feature("foot", block.face("-z"), datum="A")
    block.feature("top", block.face("+z"), tc.Profile(0.3, "A", outside=0.3))
    block.feature("width", block.face("+x"), block.face("-x"), tc.Size(10, 0.2, -0.1, cp=1, cpk=0.5))
    a.variable("warmth", tc.Tolerance(distribution=stats.uniform(1, 4)), drives={"block.Z": 0.0}, units="K")
    a.measure("height", block.point(0, 0, 10), along="z")
    sample = tc.run(compiled(a, solver="daqp"), samples=20_000, surfaces=0)["sample"].to_dataset()
    drawn, said = sample["deviation"], sample["mean_shift"]
    assert len({round(float(one), 9) for one in said}) >= 5
    assert (abs(drawn.mean("realization") - said) <= 4.5 * drawn.std("realization") / np.sqrt(20_000) + 1e-15).all()


def test_contacts_say_which_parts_touch_and_which_points_belong_to_a_pair(archive):
    program, _ = simulate(cases.stack(), samples=2, solver="daqp")
    contact = xr.load_datatree(archive)["contact"].to_dataset()
    assert contact["moving_part"].values.tolist() == [1, 2] and contact["reference_part"].values.tolist() == [0, 1]
    of = contact["pair_of_point"].values
    for k, pair in enumerate(program.nominal.pairs):
        assert np.abs(contact["moving_point"].values[of == k] - pair.P_m).max() < 1e-12
        assert (contact["reference_normal"].values[of == k] == [0, 0, 1]).all()
    assert (contact["locator_of_point"].values == -1).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "told"),
    [({"seed": 4}, "seed = 3, now it is 4"), ({"keep": "poses"}, "kept = all"), ({"surfaces": 9}, "surfaces = 12, now it is")],
)
def test_resuming_another_run_is_refused(wrong, told, archive):
    same = {"samples": 300, "seed": 3, "solver": "daqp", "surfaces": 12, "method": PAPER}
    with pytest.raises(ArchiveError, match=told):
        tc.run(cases.stack(), out=archive, resume=True, **{**same, **wrong})


@pytest.mark.slow
def test_resuming_a_model_whose_mesh_was_replaced_is_refused(tmp_path):
    def model(width):
        trimesh.creation.box(bounds=[[0, 0, 0], [width, 10, 10]]).export(tmp_path / "block.stl")
        a = tc.Assembly("replaced")
        floor = a.part("floor", tc.Box(10, 10, 10), at=(0, 0, -10), fixed=True)
        block = a.part("block", tc.Mesh(tmp_path / "block.stl"))
        a.locate(block, cases.translating(1))
        a.contact("seat", moving=block.face("-z"), reference=floor.face("+z"), points=9)
        a.measure("height", block.point(5, 5, 10), along="z")
        return a

    run = {"samples": 5, "solver": "daqp", "out": tmp_path / "out.nc"}
    tc.run(model(10), **run).close()
    tc.run(model(10), **run, resume=True).close()
    with pytest.raises(ArchiveError, match=r'part "block" had another shape|another model'):
        tc.run(model(10.001), **run, resume=True)


@pytest.mark.slow
def test_history_tells_when_a_run_went_on(archive, tmp_path):
    path = tmp_path / "copy.nc"
    path.write_bytes(archive.read_bytes())
    tc.run(cases.stack(), samples=400, seed=3, solver="daqp", method=PAPER, out=path, resume=True, surfaces=12).close()
    attributes = xr.load_dataset(path).attrs
    begun, resumed = attributes["history"].splitlines()
    assert begun.endswith("created") and resumed.endswith("resumed after 0 realizations") and attributes["samples"] == 400


def test_the_library_has_a_checksum_of_every_array(archive):
    with netCDF4.Dataset(archive) as file:
        groups = [file, *file.groups.values(), *file["field"].groups.values()]
        arrays = [variable for group in groups for variable in group.variables.values() if variable.ndim]
        assert len(arrays) > 80 and all(variable.filters()["fletcher32"] for variable in arrays)


@pytest.mark.slow
def test_the_fields_of_a_run_that_broke_off_are_at_most_some_seconds_old(tmp_path):
    """Nobody can be asked to finish what a crash ended: fields are written as the run goes on."""

    def break_off(rows):
        time.sleep(2.1)
        if rows >= 8192:
            raise LookupError("something else")

    program, run = compiled(cases.one_dimensional(6), solver="daqp"), {"seed": 3, "keep": "measures", "surfaces": 0}
    with pytest.raises(LookupError):
        tc.run(program, samples=20_000, out=tmp_path / "broken.nc", progress=break_off, **run)
    tc.run(program, samples=8192, out=tmp_path / "whole.nc", **run).close()
    broken, whole = (xr.load_dataset(tmp_path / name, group="field/block") for name in ("broken.nc", "whole.nc"))
    assert int(broken["realizations"]) == 8192
    for name in ("mean", "six_sigma", "magnitude_six_sigma_interval"):
        assert (broken[name].values == whole[name].values).all()
