"""Insides of `workflow` under the claims of `tests/test_resuming.py`."""

import netCDF4
import pytest

import tolcontact as tc
from tests import cases
from tolcontact.archive import Run
from tolcontact.workflow.runs import write_archive

SETTINGS = Run(seed=3, samples=9000, keep="measures", surfaces=0, fields="some")


@pytest.mark.slow
@pytest.mark.parametrize(("interval", "written"), [(0.0, [True, True]), (1e9, [False, True])])
def test_checkpoints_come_after_whole_blocks_when_they_are_due_and_after_the_last(interval, written, tmp_path):
    path, present = tmp_path / "run.nc", []
    write_archive(
        path, tc.build(cases.stack(), solver="daqp"), SETTINGS._replace(checkpoint_interval=interval),
        progress=lambda _: present.append(path.with_name(".run.nc.checkpoint").exists()),
    )  # fmt: skip
    assert present[:2] == written
    with netCDF4.Dataset(path) as file:
        assert file["summed_rows"][...] == 8192


@pytest.mark.slow
def test_a_resumed_run_goes_on_after_the_newest_checkpoint(tmp_path):
    path, program = tmp_path / "run.nc", tc.build(cases.stack(), solver="daqp")
    for samples, after in ((9000, None), (9001, 8192), (13_000, 8192), (13_001, 12_288)):
        settings = SETTINGS._replace(samples=samples, checkpoint_interval=0.0)
        write_archive(path, program, settings, is_resumed=after is not None)
        with netCDF4.Dataset(path) as file:
            assert after is None or file.history.splitlines()[-1].endswith(f"resumed after {after} realizations")
