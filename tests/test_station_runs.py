"""Runs of assemblies with stations: archives, resumed runs, workers, lazy datasets, JSON, and what is refused."""

import netCDF4
import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests.cases import stations as cases
from tests.helpers import compiled, contents, run, script
from tolcontact.archive import bytes_of_rows
from tolcontact.errors import ArchiveError, ModelError
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run

GROUPS = (None, "sample", "contact", "station/weld", "station/check", "field/a", "field/b", "field/c")


@pytest.fixture(scope="module")
def program():
    return compiled(cases.rail(), solver="daqp")


@pytest.fixture(scope="module")
def archive(program, tmp_path_factory):
    path = tmp_path_factory.mktemp("stations") / "whole.nc"
    tc.run(program, samples=5000, seed=3, out=path, surfaces=8).close()
    return path


def test_an_archive_holds_every_station(archive, program):
    (block,) = tc.simulate_blocks(program, samples=300, seed=3)
    with xr.open_datatree(archive) as results:
        assert results.attrs["format"] == 1
        assert results.measure_station.values.tolist() == ["weld", "check"]
        assert results.pair_station.values.tolist() == ["weld"]
        assert results.part_station.values.tolist() == ["check"] * 3
        assert (results.measured[:300] == block.measured).all()
        first, worst = 0, np.zeros(300, dtype=int)
        for number, scene in enumerate(program.nominal.scenes):
            station, count = results[f"station/{scene.station}"], len(scene.assembly.parts)
            poses = block.poses[:, :, first : first + count]
            assert station.station_part.values.tolist() == [part.name for part in scene.assembly.parts]
            assert (station.station_rotation[:300].values.reshape(300, 2, count, 9) == poses[..., :9]).all()
            assert (station.station_translation[:300] == poses[..., 9:]).all()
            assert (station.station_status[:300] == block.station_status[:, number]).all()
            first, worst = first + count, np.maximum(worst, block.station_status[:, number])
        assert (results.translation[:300] == block.poses[:, :, -3:, 9:]).all()
        assert (results.status[:300] == worst).all() and set(worst) == {0, 1}
        assert not results["station/check"].station_status.any()
    assert_gaps_recompute(archive)
    assert_resolved(archive)


def test_its_model_is_rebuilt_also_from_json(archive, program, tmp_path):
    with tc.open_archive(archive) as results:
        rebuilt = tc.io.model_of(results)
        assert [station.name for station in rebuilt.stations] == ["weld", "check"]
    tc.io.write_model(cases.rail(), tmp_path / "rail.json")
    own, *others = (
        tc.run(one, samples=300, seed=3, surfaces=8)
        for one in (program, *(compiled(model, solver="daqp") for model in (rebuilt, tmp_path / "rail.json")))
    )
    for other in others:
        assert_same_run(other, own)


def test_a_run_is_resumed(archive, program, tmp_path):
    path = tmp_path / "grown.nc"
    for samples in (300, 5000):
        tc.run(program, samples=samples, seed=3, out=path, surfaces=8, resume=path.exists()).close()
    for group in GROUPS:
        assert contents(path, group).identical(contents(archive, group)), group
    assert_same_run(path, archive)


def test_the_bytes_of_a_row_are_foreseen(program):
    for keep in ("measures", "poses", "all"):
        results = tc.run(program, samples=50, keep=keep, surfaces=0)
        rows = [
            v for node in results.subtree for v in node.to_dataset(inherit=False).variables.values() if "realization" in v.dims
        ]
        assert bytes_of_rows(program.nominal, keep, 50) == sum(v.dtype.itemsize * v.size for v in rows), keep


def test_a_lazy_dataset_is_that_of_a_run(archive):
    lazy = tc.simulate(cases.rail(), 5000, seed=3, solver="daqp")
    with tc.open_archive(archive) as results:
        for name in ("measured", "translation", "rotation", "gap_min", "status"):
            assert (lazy[name].values == results[name].values).all(), name


@pytest.mark.nightly
def test_a_run_may_be_killed_at_any_of_its_writes(tmp_path):
    done = run(script("kill_at_each_write", tmp_path, 15, "stations"))
    assert done.returncode == 0, done.stderr


def faulty(change):
    """A line of two stations with one fault."""
    line = tc.Assembly("line")
    a, b = line.part("a", tc.Box(20, 20, 20)), line.part("b", tc.Box(20, 20, 20), at=(30, 0, 0))
    weld, check = line.station("weld"), line.station("check")
    weld.locate(a, cases.box_scheme(a), tolerance=1)
    weld.locate(b, cases.box_scheme(b), tolerance=1)
    ab = weld.join("ab", a, b)
    check.measure("height", b.point(0, 0, 0), along="z")
    change(line, a, b, weld, check, ab)
    return line


def pinned(a, b):
    rests = [tc.Locator(f"A{k}", a.point(*p), "z") for k, p in enumerate([(0, 0, 0), (0, 10, 0)])]
    sides = [tc.Locator("B1", a.point(5, 0, 5), "y"), tc.Locator("B2", b.point(5, 0, 5), "y")]
    return [*rests, tc.Locator("A3", b.point(10, 5, 0), "z"), *sides, tc.Locator("C1", a.point(0, 5, 5), "x")]


FAULTS = {
    "a part is not held": (
        lambda line, a, b, weld, check, ab: check.locate(line.part("c", tc.Box(20, 20, 20)), []),
        'measurement "height" (test_station_runs.py:{}): station "check" does not hold joint "ab" with part "b"; locate it '
        "there: check.locate(...)",
    ),
    "a part of a joint is located": (
        lambda line, a, b, weld, check, ab: check.locate(b, cases.box_scheme(b), tolerance=1),
        'station "check" locates part "b", which is in joint "ab" since station "weld"; locate that joint',
    ),
    "a joint is located twice": (
        lambda line, a, b, weld, check, ab: [check.locate(ab, pinned(a, b), tolerance=1) for _ in range(2)],
        'joint "ab" (test_station_runs.py:{}): station "check" locates it twice, first in test_station_runs.py:',
    ),
    "a part is joined twice": (
        lambda line, a, b, weld, check, ab: (check.locate(ab, pinned(a, b), tolerance=1), weld.join("ba", b, a)),
        'joint "ba" (test_station_runs.py:{}): station "weld" joins part "b" twice, first in joint "ab"',
    ),
    "a part leaves its joint": (
        lambda line, a, b, weld, check, ab: (
            check.locate(ab, pinned(a, b), tolerance=1),
            check.locate(c := line.part("c", tc.Box(20, 20, 20), at=(0, 20, 0)), cases.box_scheme(c), tolerance=1),
            check.join("ac", a, c),
        ),
        'station "check" joins part "a", which is in joint "ab" since station "weld"; join that joint',
    ),
    "a joint is a mechanism": (
        lambda line, a, b, weld, check, ab: check.locate(ab, pinned(a, b)[:5], tolerance=1),
        'joint "ab" (test_station_runs.py:{}): it has 5 locators; a part needs six independent ones',
    ),
    "locators of a joint hold the same": (
        lambda line, a, b, weld, check, ab: check.locate(
            ab, [*pinned(a, b)[:5], tc.Locator("B3", b.point(5, 10, 5), "y")], tolerance=1
        ),
        'joint "ab" (test_station_runs.py:{}): its 6 locators do not fix it',
    ),
    "a locator of a joint is at no part": (
        lambda line, a, b, weld, check, ab: check.locate(
            ab, [*pinned(a, b)[:5], tc.Locator("C1", (0, 5, 5), "x")], tolerance=1
        ),
        'locator "C1": it is at no part of joint "ab"; give part.point(x, y, z)',
    ),
    "a declaration belongs to no station": (
        lambda line, a, b, weld, check, ab: (
            check.locate(ab, pinned(a, b), tolerance=1), line.measure("b", b.point(0, 0, 0), along="x")
        ),
        'measurement "b" (test_station_runs.py:{}) belongs to no station; declare it in one: station.measure(...)',
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", FAULTS)
def test_a_fault_of_the_sequence_is_one_message(case):
    change, message = FAULTS[case]
    with pytest.raises(ModelError) as refused:
        tc.build(faulty(change))
    fragments = message.split("{}")
    hits = [fault for fault in refused.value.faults if all(fragment in fault for fragment in fragments)]
    assert len(hits) == 1, refused.value
    assert case == "a part is not held" or len(refused.value.faults) == 1, refused.value


def test_raw_states_follow_raw_states_and_gaps_are_those_of_each_station():
    linear = tc.Method(resolution="linearized", objective="all points")
    with_contact, without = (
        tc.run(compiled(cases.three_stations(1.0, contact=contact), solver="daqp", method=linear), samples=60, surfaces=0)
        for contact in (True, False)
    )
    raw = [results.measured.sel(state="raw").values for results in (with_contact, without)]
    assert np.abs(raw[0] - raw[1]).max() < 1e-12
    moved = with_contact["station/weld"].station_status.values > 0
    assert moved.sum() > 10 and (with_contact.gap_min.sel(state="raw", pair="butt").values[moved] < 0).any()
    assert_gaps_recompute(with_contact)


@pytest.mark.parametrize("damage", ["parts", "measures", "group"])
def test_stations_that_do_not_fit_the_archive_are_damage(archive, damage, tmp_path):
    path = tmp_path / "damaged.nc"
    path.write_bytes(archive.read_bytes())
    with netCDF4.Dataset(path, "r+") as file:
        file.set_auto_mask(False)
        if damage == "group":
            file["station/weld"].station = "other"
        else:
            stored = file["station/weld/station_part"] if damage == "parts" else file["measure_station"]
            stored.set_auto_chartostring(False)
            stored[0, 0] = b"x"
    with pytest.raises(ArchiveError, match=r"is damaged: .* does not have"):
        tc.open_archive(path)
