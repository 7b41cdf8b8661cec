"""Insides of `geometry` under the claims of `tests/test_shape_reader.py`."""

import subprocess

import pytest
import trimesh

import tolcontact as tc
from tests.step_files import step_block
from tolcontact.geometry.files import ReadingLimits, read_files


@pytest.mark.slow
def test_a_file_that_takes_too_much_memory_is_a_fault(tmp_path):
    trimesh.creation.icosphere(7).export(tmp_path / "fine.obj")
    (fault,) = read_files([tc.Mesh(tmp_path / "fine.obj")], ReadingLimits(memory=350 * 2**20)).values()
    assert "takes more than 0.342 GiB of memory" in str(fault)


def test_the_process_that_was_started_early_reads_the_files(tmp_path, early_process, monkeypatch):
    monkeypatch.setattr(subprocess, "Popen", None)
    (tmp_path / "block.step").write_text(step_block())
    (tmp_path / "rotten.step").write_text(step_block().replace("VERTEX_POINT", "VERTEX_PINT"))
    block, rotten = read_files([tc.Mesh(tmp_path / name) for name in ("block.step", "rotten.step")]).values()
    assert len(block.shapes[0].triangles) == 12 and "rotten.step" in str(rotten)
    assert early_process.poll() is not None
