"""Files round coordinates: contact allows for it, so that bodies without clearance fit as they are stored."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases.stored import FAR, ascii_stl, stored, stored_case
from tests.helpers import FIXED, call, compiled, nightly
from tolcontact.stored_coordinates import printed_spacing
from tolcontact.testing import assert_gaps_recompute, assert_resolved

QUICK = {"samples": 24, "surfaces": 0, "fields": "none"}
KEPT = QUICK | {"keep": "all"}
BOX = trimesh.creation.box(bounds=[(0, 0, 0), (20, 12.5, 8)])
TURNED = trimesh.Trimesh(BOX.vertices, BOX.faces).apply_transform(trimesh.transformations.euler_matrix(0.3, 0.5, 1.1))
ABROAD = TURNED.copy().apply_translation(FAR)
WHOLE = trimesh.Trimesh(np.arange(30).reshape(-1, 3) + 101, [(k, k + 1, k + 2) for k in range(8)], process=False)
INCHES = trimesh.Trimesh(25.4 * (WHOLE.vertices - 100), WHOLE.faces, process=False)
SINGLE = trimesh.Trimesh(ABROAD.vertices.astype(np.float32).astype(float), ABROAD.faces, process=False)


@pytest.mark.parametrize("seed", [1, *nightly(2, 3, 8, 9)])
@pytest.mark.parametrize(("name", "faces"), [("key", True), ("dovetail", False), *nightly(("key", False), ("dovetail", True))])
def test_bodies_without_clearance_fit_in_files_of_single_precision(name, faces, seed, tmp_path):
    run = tc.run(compiled(stored_case(name, tmp_path, faces=faces, seed=seed)), **KEPT)
    assert_resolved(run)
    assert_gaps_recompute(run)
    error = run["contact"].coordinate_error.values
    assert ((2e-4 < error) & (error < 4.3e-4)).all()
    assert float(run.gap_min.sel(state="corrected").min()) > -1e-8


@pytest.mark.parametrize(
    "suffix, options, largest",
    [
        ("obj", {"units": "in"}, 1e-6),
        *nightly(("ply", {}, 4.3e-4), ("stl", {"units": "m"}, 4.3e-4), ("stl", {"number": "%.2f"}, 0.02)),
    ],
)
def test_bodies_without_clearance_fit_in_other_files(suffix, options, largest, tmp_path):
    run = tc.run(compiled(stored_case("key", tmp_path, suffix, faces=True, **options)), **KEPT)
    assert_resolved(run)
    assert_gaps_recompute(run)
    error = run["contact"].coordinate_error.values
    assert ((0 < error) & (error < largest)).all()


@pytest.mark.nightly
def test_fixed_contact_points_allow_for_rounding_too(tmp_path):
    run = tc.run(compiled(stored_case("key", tmp_path, faces=True), method=FIXED), **KEPT)
    assert_resolved(run)
    assert_gaps_recompute(run)


def test_a_ball_rests_lower_by_the_rounding_of_its_file(tmp_path):
    ball = trimesh.creation.icosphere(subdivisions=3, radius=10).apply_translation((0, 0, 500))

    def height(geometry):
        a = tc.Assembly("ball")
        floor, part = a.part("floor", tc.Box(40, 40, 5), at=(-20, -20, 485), fixed=True), a.part("ball", geometry)
        points = [(*((-5, -5, 490), (5, -5, 490), (0, 5, 490)), "z"), (*((-5, 0, 490), (5, 0, 490)), "y"), ((0, 0, 490), "x")]
        rows = [(p, axis) for *places, axis in points for p in places]
        a.locate(part, [tc.Locator(f"L{k}", p, axis) for k, (p, axis) in enumerate(rows)], tolerance=1)
        a.contact("foot", moving=part.face(), reference=floor.face("+z"))
        a.measure("height", part.point(0, 0, 500), along="z", tolerance=1)
        return tc.run(compiled(a), **KEPT)

    exact, rounded = height(tc.Mesh(ball)), height(stored(ball, tmp_path / "ball.stl"))
    assert_gaps_recompute(rounded)
    error = rounded["contact"].coordinate_error.item()
    lower = exact.measured.sel(state="corrected") - rounded.measured.sel(state="corrected")
    assert 1e-5 < error < 4e-5
    assert float(lower.max()) == pytest.approx(error, rel=0.5)


@pytest.mark.parametrize("at", [FAR, *nightly(((0, 0, 0),))])
def test_a_pin_without_clearance_fits_as_its_fitted_cylinder_does(at, tmp_path):
    R, a = Rotation.random(random_state=5).as_matrix(), tc.Assembly("pin")
    geometries = []
    for name, mesh in (
        ("plate", trimesh.creation.annulus(5, 20, 10, sections=64)),
        ("pin", trimesh.creation.cylinder(5, 20, sections=64)),
    ):
        turned = trimesh.Trimesh(mesh.vertices @ R.T + at, mesh.faces, process=False)
        geometries.append(stored(turned, tmp_path / f"{name}.stl"))
    plate, pin = a.part("plate", geometries[0], fixed=True), a.part("pin", geometries[1])
    rows = [((5, 0, 0), 2), ((-5, 0, 0), 2), ((0, 5, 0), 2), ((0, 0, 0), 1), ((5, 0, 0), 1), ((0, 0, 0), 0)]
    locators = [tc.Locator(f"L{k}", tuple(R @ p + at), tuple(R[:, axis])) for k, (p, axis) in enumerate(rows)]
    a.locate(pin, locators, tolerance=0.1)
    a.contact("fit", moving=pin.face(tc.select.Cylinder()), reference=plate.face(tc.select.Cylinder(inner=True, radius=5)))
    a.measure("place", pin.point(*at), along="z", tolerance=1)
    run = tc.run(compiled(a), **KEPT)
    assert_resolved(run)
    assert_gaps_recompute(run)


def test_exact_coordinates_have_no_error():
    program = compiled(stored_case("key", None, faces=True))
    assert all(pair.coordinate_error == 0 for pair in program.nominal.pairs)
    assert program.stored_coordinates == ""
    assert "coordinate_error" not in tc.run(program, **QUICK)["contact"]


def test_a_model_from_an_archive_has_the_error_of_its_files(tmp_path):
    tc.run(compiled(stored_case("key", tmp_path, faces=True)), **QUICK, out=tmp_path / "first.nc")
    with tc.open_archive(tmp_path / "first.nc") as first:
        again = tc.run(compiled(tc.io.model_of(first)), **QUICK)
        errors = first["contact"].coordinate_error.values
        assert (again["contact"].coordinate_error.values == errors).all() and (errors > 0).all()
        assert again.measured.values == pytest.approx(first.measured.values, abs=1e-9)


def test_the_summary_and_the_check_say_what_contact_allows(tmp_path):
    (tmp_path / "model.py").write_text(
        "from pathlib import Path\nfrom tests.cases.stored import stored_case\n"
        "def assembly():\n    return stored_case('key', Path(__file__).parent, faces=True)\n"
    )
    line = 'coordinates of "key" and "block" are stored to 0.00024 mm; contact allows 0.00028 mm'
    assert line in call(tmp_path, "check", "model.py").stdout
    assert line in " ".join(call(tmp_path, "run", "model.py", "--samples", 10).stdout.split())


@pytest.mark.parametrize(
    "mesh, number, spacing",
    [
        (BOX, "%.6f", 0), (BOX, "%g", 0), (BOX, "%r", 0),  # design dimensions
        (WHOLE, "%g", 0), (INCHES, "%g", 0),
        (TURNED, "%.6f", 1e-6), (TURNED, "%.3f", 1e-3), (TURNED, "%g", 1e-4), (TURNED, "%.4e", 1e-3), (TURNED, "%r", 0),
        (ABROAD, "%.6f", 1e-6), (ABROAD, "%g", 1e-2), (ABROAD, "%e", 1e-3), (ABROAD, "%r", 0),
        (SINGLE, "%.6f", 2.0**-12), (SINGLE, "%r", 2.0**-12), (SINGLE, "%.2f", 1e-2),
    ],
)  # fmt: skip
def test_the_digits_of_a_text_tell_how_exact_it_is(mesh, number, spacing):
    assert printed_spacing(ascii_stl(mesh, number).encode(), "stl") == pytest.approx(spacing)
