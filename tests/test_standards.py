"""The standard of a drawing: envelopes of sizes, separate and combined zones of patterns, and how models state it."""

import io
import json

import numpy as np
import pytest
import rich.console
import scipy
import trimesh

import tolcontact as tc
from tests.cases.toleranced import pattern_with, plate_with_holes
from tests.helpers import simulate
from tests.test_form import coefficients
from tolcontact.report import summary_text
from tolcontact.vocabulary import CORRECTED

RADIUS, LENGTH = 5.0, 30.0
Z, ANGLE = (grid.ravel() for grid in np.meshgrid(np.linspace(-15, 15, 25), np.arange(96) * np.pi / 48, indexing="ij"))
WALL = np.column_stack([RADIUS * np.cos(ANGLE), RADIUS * np.sin(ANGLE), Z])
NORMALS = np.column_stack([np.cos(ANGLE), np.sin(ANGLE), 0 * ANGLE])


def round_part(size: tc.Size, *, inner: bool, standard: str = "", form: float = 0.01) -> tc.Assembly:
    """A fixed pin, or a ring, with a round face of radius 5 that has size and form."""
    a = tc.Assembly("round", standard=standard)
    shape = trimesh.creation.annulus(RADIUS, 9, LENGTH, sections=96) if inner else trimesh.creation.cylinder(RADIUS, LENGTH)
    part = a.part("part", tc.Mesh(shape), fixed=True)
    face = part.feature("wall", part.face(tc.select.Cylinder(RADIUS)), size, tc.Cylindricity(form))
    a.measure("x", face.point(RADIUS, 0, 0), along="x")
    return a


def depths_in_gauge(model: tc.Assembly, samples: int) -> np.ndarray:
    """How far (realization,) [mm] each wall is at least beyond a perfect cylinder of radius 5, which may lie anywhere.

    A linear programme over shifts and tilts of the gauge, for heights on a grid that the package does not use.
    """
    program, run = simulate(model, samples=samples, solver="daqp")
    feature = program.nominal.features[0]
    outward = coefficients(program, run, "wall") @ feature.form.heights(WALL).T
    outward += run["deviations"][:, feature.size_column, None] * (-0.5 if feature.geometry.is_inner else 0.5)
    motions = np.column_stack([NORMALS[:, :2], Z * NORMALS[:, 0], Z * NORMALS[:, 1]])
    A = np.column_stack([motions, -np.ones(len(WALL))])
    bounds = [(None, None)] * 5
    return np.array([scipy.optimize.linprog([0, 0, 0, 0, 1], A, -heights, bounds=bounds).fun for heights in outward])


@pytest.mark.parametrize("inner", [False, True], ids=["pin", "bore"])
def test_every_part_enters_its_envelope_and_by_independency_some_do_not(inner):
    """A pin 10 (0/-0.015), or a bore 10 (+0.015/0), with cylindricity 0.01 and a perfect gauge of 10.000."""
    limits = (0.015, 0.0) if inner else (0.0, -0.015)
    sizes = {choice: tc.Size(10, *limits, distribution="truncated normal", envelope=choice) for choice in (True, False, None)}
    enveloped = depths_in_gauge(round_part(sizes[True], inner=inner), 60)
    independent = depths_in_gauge(round_part(sizes[False], inner=inner), 60)
    assert enveloped.max() < 5e-5  # between the places at which heights are known
    assert (independent > 1e-3).mean() > 0.02
    np.testing.assert_array_equal(depths_in_gauge(round_part(sizes[None], inner=inner, standard="ASME"), 60), enveloped)
    np.testing.assert_array_equal(depths_in_gauge(round_part(sizes[None], inner=inner, standard="ISO"), 60), independent)
    np.testing.assert_array_equal(depths_in_gauge(round_part(sizes[None], inner=inner), 60), independent)


def holes(tolerance, standard: str = "", own: str = "") -> tc.Assembly:
    """Two holes at (-30, 0) and (30, 0) that one tolerance limits. Measured along x: their distance, and the place of one."""
    _, part, faces = plate_with_holes(2)
    assembly = tc.Assembly("holes", standard=standard)
    copy = assembly.part("plate", part.geometry, fixed=True, standard=own)
    for feature in part.features:
        copy.feature(feature.name, copy.face(*feature.faces[0].selections), datum=feature.datum)
    pattern = copy.pattern("H", *(copy.face(*face.selections) for face in faces), tolerance)
    first, last = pattern.members
    for end in (0, 1):
        assembly.measure(f"distance {end}", last.axis(end), to=first.axis(end), along="x")
        assembly.measure(f"place {end}", first.axis(end), along="x")
    return assembly


@pytest.mark.parametrize(
    ("standard", "own", "combined", "is_combined"),
    [
        ("", "", None, True), ("ASME", "", None, True), ("ISO", "", None, False), ("ISO", "", True, True),
        ("ASME", "", False, False), ("ASME", "ISO", None, False), ("", "ISO", None, False),
    ],
)  # fmt: skip
def test_zones_of_a_pattern_are_combined_by_asme_and_separate_by_iso(standard, own, combined, is_combined):
    """A and B leave the pattern free along x: combined zones keep the distance of the holes, separate ones do not."""
    model = holes(tc.Position(0.2, "A|B", combined=combined), standard, own)
    program, run = simulate(model, samples=4000, solver="daqp")
    relative = [label for label in program.nominal.contributors if label.startswith("plate.H.relative")]
    assert bool(relative) == is_combined
    distance, place = run["measured"][:, CORRECTED].reshape(-1, 2, 2).mean(axis=1).std(axis=0)  # in the middle of the axes
    assert (distance > 1e-3) == is_combined
    assert (place > 1e-3) == is_combined  # half of the distance, or the free motion, which nothing draws


def test_with_all_datums_both_readings_are_the_same():
    runs = [simulate(holes(tc.Position(0.2, "A|B|C"), standard), samples=200, solver="daqp")[1] for standard in ("ISO", "ASME")]
    np.testing.assert_array_equal(*(run["measured"] for run in runs))


@pytest.mark.parametrize(
    ("declare", "message"),
    [
        (lambda: tc.build(tc.Assembly("a", standard="DIN")), "standard is 'DIN'; expected one of: '', ISO, ASME"),
        (lambda: tc.build(holes(tc.Position(0.2), "ISO")), "position: it needs datums"),
        (lambda: tc.build(pattern_with(tc.Position(0.2, "A|B|C"), follower=tc.Position(0.1, "A|B|C", combined=True))),
         "combined zones are for patterns"),
        (lambda: tc.build(holes(tc.Flatness(0.2, combined=True))), "combined is given, which flatness does not have"),
        (lambda: tc.build(round_part(tc.Size(10, 0.1, envelope="yes"), inner=False)), "envelope is 'yes'; expected True"),
    ],
)  # fmt: skip
def test_what_does_not_fit_a_standard_is_refused(declare, message):
    with pytest.raises(tc.ModelError, match=message):
        declare()


def test_the_standard_is_in_the_document_the_archive_the_summary_and_the_page(tmp_path):
    model = tc.Assembly("round", standard="ASME")
    pin = model.part("part", tc.Pin(10, 30), fixed=True)
    face = pin.feature("wall", pin.face(tc.select.Cylinder(RADIUS)), tc.Size(10, 0, -0.015), tc.Cylindricity(0.01))
    model.measure("x", face.point(RADIUS, 0, -15), along="x")
    model.part("other", tc.Box(1, 1, 1), at=(50, 0, 0), fixed=True, standard="ISO")
    path = tmp_path / "run.nc"
    with tc.run(model, samples=50, out=path) as results:
        assert results.attrs["standard"] == "part ASME, other ISO"
        document = json.loads(str(results["model/declaration"].values))
        assert document["standard"] == "ASME"
        assert [part["standard"] for part in document["parts"]] == ["ASME", "ISO"]
        data = tmp_path / "model.json"
        tc.io.write_model(model, data)
        with tc.run(data, samples=50) as again:
            np.testing.assert_array_equal(again["measured"], results["measured"])
        console = rich.console.Console(width=100, record=True, file=io.StringIO())
        console.print(summary_text(tc.summarize(results)))
    assert "standard of the drawings: part ASME, other ISO" in console.export_text()
