"""Forms of measured faces: a seat varies as it does with the measured faces themselves; files that are none of points."""

import re
import warnings

import numpy as np
import pytest
import trimesh
from scipy.stats import chi2, t

import tolcontact as tc
from tests.cases.seats import PRESS, seat
from tests.helpers import SEATED, compiled, joined
from tests.test_form import seated
from tolcontact.simulation import simulate_blocks
from tolcontact.testing import assert_gaps_recompute
from tolcontact.vocabulary import CORRECTED

PARTS = 30


def underside(amplitudes, x, y):
    """Heights (place,) of a face made of a bowl, a saddle and waves, about a bowl that all parts have."""
    u, v = x / 50 - 1, y / 25 - 1
    shapes = np.array([u**2 + v**2, u * v, np.cos(4 * u), np.sin(5 * u + 2 * v), u**3 - v])
    return amplitudes @ shapes + 0.004 * (u**2 - v**2)


def form_of(amplitudes, x, y):
    """The same without the plane of least squares."""
    grid = np.array(np.meshgrid(np.arange(0.5, 100), np.arange(0.5, 50))).reshape(2, -1)
    plane = np.linalg.lstsq(np.vstack([grid[0] ** 0, grid]).T, underside(amplitudes, *grid), rcond=None)[0]
    return underside(amplitudes, x, y) - plane @ [x**0, x, y]


@pytest.fixture(scope="module")
def batch(tmp_path_factory):
    """The folder of the points of 30 parts, and their amplitudes (part, shape)."""
    folder, rng = tmp_path_factory.mktemp("scans"), np.random.default_rng(11)
    amplitudes = rng.normal(0, [0.006, 0.004, 0.003, 0.002, 0.002], (PARTS, 5))
    edges = np.vstack(
        [[(x, y) for x in np.linspace(0, 100, 21) for y in (0, 50)], [(x, y) for x in (0, 100) for y in range(51)]]
    )
    for number, of_part in enumerate(amplitudes):
        places = np.vstack([rng.uniform(0, 1, (900, 2)) * [100, 50], edges])
        points = np.column_stack([places, -underside(of_part, *places.T)])
        name = folder / f"part {number:02d}"
        if number % 2:
            trimesh.PointCloud(points).export(name.with_suffix(".ply"))
        else:
            np.savetxt(name.with_suffix(".csv"), points, delimiter=";", header="x;y;z", comments="")
    return folder, amplitudes


def test_a_seat_of_measured_faces_varies_as_with_the_faces_themselves(batch, tmp_path):
    folder, amplitudes = batch
    model = seat(tc.Form(measured=str(folder / "part*"), modes=12))
    program = compiled(model, solver="daqp", method=SEATED)
    form = program.nominal.features[0].form
    assert 6 <= form.modes <= 13 and (form.spreads[6:] < 1e-3 * form.spreads[1]).all()  # as many components as shapes
    assert form.left_out < 1e-6 and form.spreads[0] == 0 < form.means[0]
    # The mean of 300 draws errs by a ninth of the margin that 30 parts leave, their deviation by a third.
    run = joined(simulate_blocks(program, samples=300, seed=1))
    drawn, places = run["measured"][:, CORRECTED, 3], program.nominal.pairs[0].P_m[:, :2]
    faces = [np.array([1, *PRESS]) @ seated(form_of(of_part, *places.T), places) for of_part in amplitudes]
    margin = t.ppf(0.995, PARTS - 1) * np.std(faces, ddof=1) / PARTS**0.5
    assert abs(drawn.mean() - np.mean(faces)) < margin
    low, high = np.std(faces, ddof=1) * np.sqrt((PARTS - 1) / chi2.ppf([0.995, 0.005], PARTS - 1))
    assert low < drawn.std() < high < 2.1 * low
    x, y = (grid.ravel() for grid in np.meshgrid(np.linspace(2, 98, 25), np.linspace(2, 48, 13)))
    mean = form.means @ form.heights(np.column_stack([x, y, 0 * x])).T
    np.testing.assert_allclose(mean, form_of(amplitudes.mean(axis=0), x, y), atol=1e-4)
    path = tmp_path / "seat.nc"
    tc.run(program, samples=5, surfaces=1, out=path).close()
    assert_gaps_recompute(path)


def test_measured_faces_beyond_the_stated_flatness_are_a_warning(tmp_path):
    """A saddle h u v lies between planes that are 2 h apart, and no closer."""
    u, v = (grid.ravel() for grid in np.meshgrid(np.linspace(-1, 1, 41), np.linspace(-1, 1, 21)))
    for name, height in {"a": 0.01, "b": 0.02, "c": 0.06}.items():
        points = np.column_stack([50 * u + 50, 25 * v + 25, height * u * v + 0.1 * u])
        np.savetxt(tmp_path / f"{name}.csv", points, delimiter=",")
    form = tc.Form(measured=str(tmp_path / "*.csv"))
    with pytest.warns(tc.NominalWarning) as records:
        tc.build(seat(form))
    (text,) = [str(record.message) for record in records if "[form]" in str(record.message)]
    assert re.search(r'part "block": feature "under" \(seats.py:\d+\): 1 of 3 measured faces', text)
    width = float(re.search(r'the flatness of 0.05 mm that is stated; "c.csv" has (\S+) mm', text)[1])
    assert width == pytest.approx(0.12, rel=0.03)
    with warnings.catch_warnings(record=True) as records:
        warnings.simplefilter("always")
        tc.build(seat(form, width=0.125))
    assert not [record for record in records if "[form]" in str(record.message)]


def test_files_that_are_no_points_of_the_face_are_refused(batch, tmp_path):
    def fault(form):
        with pytest.raises(tc.ModelError) as error:
            tc.build(seat(form))
        return str(error.value)

    assert "names 0 files; expected at least 3" in fault(tc.Form(measured=str(tmp_path / "*.csv")))
    (tmp_path / "far").mkdir()
    points = np.random.default_rng(1).uniform(0, 50, (100, 3))
    for number in range(3):
        np.savetxt(tmp_path / "far" / f"{number}.csv", points)
        (tmp_path / f"{number}.csv").write_text("x,y\n1,2\n")
    assert "mm away from the face; expected points of the face" in fault(tc.Form(measured=str(tmp_path / "far" / "*")))
    (tmp_path / "few").mkdir()
    for path in batch[0].glob("*.csv"):
        few = "\n".join(path.read_text().splitlines()[:6])  # a heading and five places
        (tmp_path / "few" / path.name).write_text("\n".join([few, *few.splitlines()[1:] * 10]))
    assert "has 5 points; expected at least 24" in fault(tc.Form(measured=str(tmp_path / "few" / "*")))
    lines = "expected lines of three numbers x, y, z [mm] up to 1e+15, in the frame of the part"
    texts = {
        "x,y\n1,2\n": f'0.csv" cannot be read as measured points: line 2 is "1,2"; {lines}',
        "1 2 3\n4 5 6 7": f'0.csv" cannot be read as measured points: line 2 is "4 5 6 7"; {lines}',
        "x;y;z\n1,5;2;3": f'line 2 is "1,5;2;3"; {lines}; write decimals with points',
        "": f'0.csv" has no points; {lines}',
        "1,2,3\n4,nan,6\n": f'line 2 is "4,nan,6"; {lines}',
        "1,2,3\n4,5,1e308\n": f'line 2 is "4,5,1e308"; {lines}',
        "1,2,3\n4\n": f'line 2 is "4"; {lines}',
    }
    for text, message in texts.items():
        (tmp_path / "0.csv").write_text(text)
        assert message in fault(tc.Form(measured=str(tmp_path / "*.csv")))
    for number in range(3):
        cloud = "ply\nformat ascii 1.0\nelement vertex 1\nproperty double x\nproperty double y\nproperty double z\nend_header\n"
        (tmp_path / f"{number}.ply").write_text(f"{cloud}1 2 1e300\n")
    assert "point 1 is (1, 2, 1e+300); expected numbers up to 1e+15" in fault(tc.Form(measured=str(tmp_path / "*.ply")))
    assert "has a covariance, a length or lobes beside" in fault(tc.Form(measured=str(batch[0] / "*"), length=3.0))
