"""A run of elastic parts in two stations that is killed goes on to the same archive."""

import pytest

import tolcontact as tc
from tests.helpers import assert_same_archive, script, start
from tests.test_elastic_parts import tips

pytestmark = pytest.mark.nightly
SAMPLES = 9000  # more than two checkpoints


def test_a_killed_run_of_tips_that_are_joined_and_released_goes_on(tmp_path):
    path, whole = tmp_path / "killed.nc", tmp_path / "whole.nc"
    with start(script("run_tips", tmp_path, path, SAMPLES)) as begun:
        for line in begun.stdout:
            if int(line) >= 4096:
                break
        begun.kill()
        begun.wait()
    assert begun.returncode == -9
    model = tips(tmp_path)
    tc.run(model, samples=SAMPLES, seed=3, out=path, resume=True).close()
    with tc.open_archive(path) as results:
        assert "resumed after" in results.attrs["history"]
        assert set(results["station"].children) == {"weld", "check"}
        assert results["elastic"].to_dataset().reaction_at_load.sizes["realization"] == SAMPLES
    tc.run(model, samples=SAMPLES, seed=3, out=whole).close()
    assert_same_archive(path, whole)
