"""Gaps left between two faces: closed forms without form, a dense grid with form, archives, and what is refused."""

import numpy as np
import pytest

import tolcontact as tc
from tests.cases.frames import STILL, Frame
from tests.cases.measured import ring, shaft
from tests.cases.seats import seat
from tests.helpers import SEATED, R_t, nightly, simulate
from tests.test_form import coefficients, modes_at
from tolcontact.vocabulary import CORRECTED, RAW

OVERLAP = np.array([(40, 0, 0), (100, 0, 0), (100, 50, 0), (40, 50, 0)], dtype=float)


def step(frame=STILL):
    """A block that hangs over the end of a table at x = 40: 60 mm of it lie over the table."""
    s = frame.scale
    a = tc.Assembly("step")
    table = a.part("table", frame.box(200, 80, 10), **frame.place(40, -10, -10), fixed=True)
    block = a.part("block", frame.box(100, 50, 10), **frame.place(0, 0, 0))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0.2 * s)
    a.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
    for name, faces in (("", (block.face("-z"), table.face("+z"))), (" back", (table.face("+z"), block.face("-z")))):
        a.measure(f"largest{name}", tc.LargestGap(*faces))
        a.measure(f"mean{name}", tc.MeanGap(*faces))
    return a


@pytest.mark.parametrize(
    "frame", [Frame(turn=(1, -2, 0.5), shift=(300, -200, 900), scale=25.4), *nightly(STILL)], ids=["turned", "mm"]
)
def test_between_planes_they_are_those_of_the_corners_and_of_the_middle_of_the_overlap(frame):
    _, run = simulate(step(frame), samples=10, solver="daqp")
    corners, up = np.array([frame.place(*corner)["at"] for corner in OVERLAP]), frame.R.apply((0, 0, 1))
    R, t = R_t(run["poses"][:, :, 1])
    over_table = (np.einsum("nsij,kj->nski", R, corners) + t[:, :, None] - corners[0]) @ up
    over_block = (np.einsum("nsji,nskj->nski", R, corners - t[:, :, None]) - corners[0]) @ -up
    for k, heights in enumerate((over_table, over_block)):
        largest, mean = np.moveaxis(run["measured"][..., 2 * k : 2 * k + 2], -1, 0)
        np.testing.assert_allclose(largest, heights.max(axis=2), atol=1e-9 * frame.scale)
        assert np.abs(mean - heights.mean(axis=2)).max() < 1e-9 * np.ptp(heights, axis=2).max()
    assert run["measured"][:, CORRECTED].min() > -1e-9 and run["measured"][:, RAW].min() < -0.01 * frame.scale


@pytest.mark.parametrize("samples", [6, *nightly(20)])
def test_with_form_they_are_those_of_a_dense_grid_in_a_run_and_in_its_archive(samples, tmp_path):
    model = seat(tc.Form(modes=6))
    faces = model.parts[1].face("-z"), model.parts[0].face("+z")
    model.measure("largest", tc.LargestGap(*faces))
    model.measure("mean", tc.MeanGap(*faces))
    results = tc.run(model, samples=samples, solver="daqp", method=SEATED, out=tmp_path / "run.nc", surfaces=0, fields="none")
    measured = results["measured"].values
    results.close()
    program, again = simulate(tmp_path / "run.nc", samples=samples, build=tc.build, solver="daqp")
    np.testing.assert_array_equal(again["measured"], measured)
    grid = np.stack(np.meshgrid(np.linspace(0, 100, 101), np.linspace(0, 50, 51)), axis=-1).reshape(-1, 2)
    places = np.column_stack([grid, np.zeros(len(grid))])
    form = coefficients(program, again, "under") @ modes_at(program, "under", places).T
    R, t = R_t(again["poses"][:, CORRECTED, 1])
    heights = (np.einsum("nij,kj->nki", R, places) + t[:, None])[..., 2] - form
    weights = np.prod([np.where(np.isin(grid[:, k], (0, side)), 0.5, 1.0) for k, side in enumerate((100, 50))], axis=0)
    largest, mean = measured[:, CORRECTED, -2:].T
    assert np.abs(largest - heights.max(axis=1)).max() < 5e-4
    assert np.abs(mean - heights @ weights / weights.sum()).max() < 2e-4
    assert 0.005 < mean.mean() < largest.mean() < 0.05


@pytest.mark.parametrize(
    ("faces", "message"),
    [(("+z", "+x"), "lie nowhere over each other"), (("+z", "+z"), "do not face each other everywhere")],
)
def test_faces_between_which_there_is_no_gap_are_refused(faces, message):
    a = step()
    block, table = a.parts[1].face(faces[0]), a.parts[0].face(faces[1])
    a.measure("none", tc.LargestGap(block, table))
    with pytest.raises(tc.ModelError, match=message):
        tc.build(a)


def test_between_a_shaft_and_its_bore_the_mean_is_the_clearance_and_the_largest_gap_that_of_the_far_end():
    a = tc.Assembly("pin")
    bore = a.part("ring", ring(), fixed=True).face(tc.select.Cylinder(inner=True))
    pin = a.part("shaft", shaft())
    across = [("x1", (0, 0, -10), "x"), ("x2", (0, 0, 10), "x"), ("y1", (0, 0, -10), "y"), ("y2", (0, 0, 10), "y")]
    along = [("z", (0, 0, -15), "z"), ("t", (3, 0, 0), "y")]
    a.locate(pin, [tc.Locator(*locator, 0.1) for locator in across + along])
    a.measure("largest", tc.LargestGap(bore, pin.face(tc.select.Cylinder())))
    a.measure("mean", tc.MeanGap(bore, pin.face(tc.select.Cylinder())))
    _, run = simulate(a, samples=20, solver="daqp")
    R, t = R_t(run["poses"][:, RAW, 1])
    # The axis of the shaft at both ends of the bore: from its wall there no way to the axis is longer than the level one.
    axes = [t + ((z - t[:, 2]) / R[:, 2, 2])[:, None] * R[:, :, 2] for z in (-6, 6)]
    ends = np.hypot(*np.moveaxis(axes, 2, 0)[:2]).max(axis=0)
    assert np.abs(run["measured"][:, RAW, 1] - 0.2).max() < 1e-4
    assert 0 <= (0.2 + ends - run["measured"][:, RAW, 0]).min() and (0.2 + ends - run["measured"][:, RAW, 0]).max() < 2e-3
