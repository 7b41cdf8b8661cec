"""What must change nothing, for many assemblies: blocks, threads, a stop, the archive, names, order, and the place in space.

Each scene is built and run once; every property is a test of that run. A model is changed through its archive: the declaration
in it is a text, and its meshes are arrays.
"""

import json

import numpy as np
import pytest
import xarray as xr

import tolcontact as tc
from tests import cases
from tests.cases import ends, fastened, fits, floating, frames, laps, measured, round_contact, seats, stations, toleranced
from tests.helpers import ALL_POINTS, EXACT, PAPER, SEATED, assert_same_archive, compiled, joined, nightly
from tolcontact.testing import assert_datums_recompute, assert_gaps_recompute

SAMPLES, SEED = 12, 5
SCENES = {
    "ra1, linearized": (cases.ra1, PAPER),
    "stack": (cases.stack, EXACT),
    "springs": (cases.table, SEATED),
    "everything": (cases.everything_of_boxes, tc.Method(objective="locator stiffness")),
    "faces that end": (lambda: ends.case("cone above")[0], None),
    "a seat with form": (lambda: seats.seat(points=40), SEATED),
    "a floating shaft": (floating.floating_shaft_in_a_v, None),
    "stations": (stations.rail, None),
    "a pattern": (lambda: toleranced.EVERY["composite pattern"](cases.STILL), EXACT),
}
AT_NIGHT = {
    "jaws": (cases.jaws, EXACT),
    "square pins": (cases.square_pins, SEATED),
    "conflicts": (cases.everything_of_boxes, SEATED),
    "a lap": (lambda: laps.case("three walls")[0], None),
    "a jammed peg": (round_contact.jammed_peg, EXACT),
    "a ball on pins": (round_contact.ball_on_three_pins, EXACT),
    "a fit with form": (lambda: fits.shaft_in_a_bore(tc.Cylindricity(0.02, form=tc.Form(length=30)), points=150), SEATED),
    "bolts": (lambda: fastened.bolted(fastened.FOUR[::3], position=(1.3, 1.3), size=0.1, is_cover_fixed=True), ALL_POINTS),
    "a lid on studs": (floating.lid_on_studs, None),
    "three stations": (lambda: stations.three_stations(0.3), EXACT),
    "measurements": (measured.seated, None),
}
# mm: sampled points of planes with form depend on the frame.
OF_FRAME = {"a seat with form": 1e-4}


class Scene:
    """An assembly, its program, and the archive of a run."""

    def __init__(self, name, folder):
        self.name, (self.model, self.method) = name, (SCENES | AT_NIGHT)[name]
        model = self.model()
        self.program, self.path = self.compiled(model), folder / "run.nc"
        self.run(out=self.path).close()
        self.results = xr.load_datatree(self.path)
        self.block = joined(tc.simulate_blocks(self.program, samples=SAMPLES, seed=SEED, block=5, threads=2))
        # What a user's function computes turns with nothing.
        self.fixed_in_space = [measure.name for measure in model.measures if callable(measure.of)]

    def run(self, samples=SAMPLES, **options):
        return tc.run(self.program, samples=samples, seed=SEED, surfaces=4, **options)

    def compiled(self, model):
        return compiled(model, solver="daqp", method=self.method)

    def changed(self, change):
        """The program of the model that is in the archive, and its block, after a change of its declaration (a dict)."""
        tree = self.results.copy()
        document = json.loads(str(tree["model"]["declaration"].values))
        change(document)
        tree["model"]["declaration"] = xr.DataArray(json.dumps(document))
        program = self.compiled(tc.io.model_of(tree))
        return program, joined(tc.simulate_blocks(program, samples=SAMPLES, seed=SEED))


@pytest.fixture(scope="module", params=[*SCENES, *nightly(*AT_NIGHT)])
def scene(request, tmp_path_factory):
    return Scene(request.param, tmp_path_factory.mktemp("scene"))


def test_neither_blocks_nor_threads_nor_the_problem_before_change_a_bit(scene):
    assert np.array_equal(scene.block["measured"], scene.results["measured"], equal_nan=True)
    assert np.array_equal(scene.block["status"], scene.results["status"])
    (late,) = tc.simulate_blocks(scene.program, samples=SAMPLES, seed=SEED, start=SAMPLES - 3)
    assert np.array_equal(late.poses, scene.block["poses"][-3:], equal_nan=True)


def test_a_run_that_stopped_goes_on_to_the_same_archive(scene, tmp_path):
    for samples in (5, SAMPLES):
        scene.run(samples, out=tmp_path / "grown.nc", resume=samples == SAMPLES).close()
    assert_same_archive(tmp_path / "grown.nc", scene.path)


def test_the_model_in_an_archive_gives_the_run_again_and_names_of_pairs_are_free(scene):
    """Labels of contributors choose their draws; the names of the assembly and its pairs choose nothing."""

    def renamed(document):
        document["name"] = 'Ärger, \'n "Haus" #1'
        for pair in document["pairs"]:
            pair["name"] += " \u4e2d\u6587 =1+1"

    _, again = scene.changed(renamed)
    for name, values in scene.block.items():
        np.testing.assert_array_equal(again[name], values, err_msg=name)


def test_neither_the_place_in_space_nor_the_order_of_declarations_changes_anything(scene):
    """All parts, the directions of measures and the forces are turned and shifted; lists are declared from the end."""

    def turned(document):
        frames.turn(document)
        for name in ("parts", "pairs", "measures", "locations", "forces"):
            document[name].reverse()
        document["measures"].sort(key=lambda measure: "measurements" in measure.get("of", ()))  # after those that they combine

    program, again = scene.changed(turned)
    names = [measure.name for measure in program.nominal.measures]
    order = [names.index(name) for name in scene.results["measure"].values]
    there = ~np.isin(scene.results["measure"].values, scene.fixed_in_space)
    np.testing.assert_allclose(
        again["measured"][..., order][..., there], scene.block["measured"][..., there], rtol=0,
        atol=OF_FRAME.get(scene.name, 1e-8),
    )  # fmt: skip
    assert np.array_equal(again["status"], scene.block["status"])


def test_gaps_and_datums_recompute_from_the_archive(scene):
    if "contact" in scene.results.children:
        assert_gaps_recompute(scene.path)
    if "datum" in scene.results.children:
        assert_datums_recompute(scene.path)
