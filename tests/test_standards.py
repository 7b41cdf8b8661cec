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
from tests.helpers import nightly, simulate
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


def depths_in_gauge(model: tc.Assembly, samples: int, oversize: float = 0.0) -> np.ndarray:
    """How far (realization,) [mm] each wall is at least beyond a perfect cylinder, which may lie anywhere.

    Its diameter is 10 and an `oversize`.

    A linear programme over shifts and tilts of the gauge, for heights on a grid that the package does not use.
    """
    program, run = simulate(model, samples=samples, solver="daqp")
    feature = program.nominal.features[0]
    outward = coefficients(program, run, "wall") @ feature.form.heights(WALL).T
    outward += (run["deviations"][:, feature.size_column, None] - oversize) * (-0.5 if feature.geometry.is_inner else 0.5)
    motions = np.column_stack([NORMALS[:, :2], Z * NORMALS[:, 0], Z * NORMALS[:, 1]])
    A = np.column_stack([motions, -np.ones(len(WALL))])
    bounds = [(None, None)] * 5
    return np.array([scipy.optimize.linprog([0, 0, 0, 0, 1], A, -heights, bounds=bounds).fun for heights in outward])


@pytest.mark.parametrize(("inner", "oversize"), [(False, 0.01), *nightly((True, 0.01), (False, 0.0))])
def test_every_part_enters_its_envelope_and_by_independency_some_do_not(inner, oversize):
    """A pin (0/-0.015) or a bore (+0.015/0) with cylindricity 0.01 about a perfect gauge of its maximum material."""
    limits = (oversize + 0.015, oversize) if inner else (oversize, oversize - 0.015)

    def depths(envelope: bool | None, standard: str = "") -> np.ndarray:
        size = tc.Size(10, *limits, distribution="truncated normal", envelope=envelope)
        return depths_in_gauge(round_part(size, inner=inner, standard=standard), 60, oversize)

    enveloped, independent = depths(True), depths(False)
    assert enveloped.max() < 5e-5  # between the places at which heights are known
    assert (independent > 1e-3).mean() > 0.02
    assert enveloped[independent > 1e-3].min() > -1e-3  # forms are scaled until they touch the envelope
    np.testing.assert_array_equal(depths(None, "ASME"), enveloped)
    np.testing.assert_array_equal(depths(None, "ISO"), independent)
    np.testing.assert_array_equal(depths(None), independent)


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


PIN_STOPS = (
    ((0, 0, 0), "z"), ((3.75, 0, 0), "y"), ((0, 0, -20), "x"), ((0, 0, -20), "y"), ((0, 0, 0), "x"), ((0, 0, 0), "y"),
)  # fmt: skip


def bored(tolerance, standard: str, *own, mated: bool = False, holes: int = 1) -> tc.Assembly:
    """A plate with a bore 8 (+0.2/0), datum B, and holes that are located to it; each is measured from the bore along x."""
    _, plate, faces = plate_with_holes(1 + holes)
    a = tc.Assembly("bored", standard=standard)
    part = a.part("plate", plate.geometry, fixed=True)
    for letter, datum in zip("AC", plate.features[::2], strict=True):
        part.feature(letter, part.face(*datum.faces[0].selections), datum=letter)
    bore = part.feature("bore", part.face(*faces[0].selections), tc.Size(8, 0.2, 0, distribution="uniform"), *own, datum="B")
    for number, face in enumerate(faces[1:]):
        own_tolerance = tolerance[number] if isinstance(tolerance, tuple) else tolerance
        hole = part.feature(f"hole {number}", part.face(*face.selections), own_tolerance)
        for end in (0, 1):
            a.measure(f"{hole.name} at {end}", hole.axis(end), to=bore.axis(end), along="x")
    if mated:
        pin = a.part("pin", tc.Pin(7.5, 20), at=(-30, 0, 10), fixed=False)
        a.locate(pin, [tc.Locator(f"L{k}", place, way, 0) for k, (place, way) in enumerate(PIN_STOPS)])
        a.contact("fit", moving=pin.face(tc.select.Cylinder(3.75)), reference=bore)
    return a


def test_a_datum_at_maximum_material_has_the_play_of_its_gauge():
    """A bore 8 +0.2/0 as datum B(M), and a hole 0.1 to it: 0.05 and 0.1 in the worst case, and sums of variances."""
    model = bored(tc.Position(0.1, "A|B(M)"), "ASME")
    program, run = simulate(model, samples=8000, solver="daqp")
    assert [label for label in program.nominal.contributors if "mobility" in label] == [
        "plate.bore.mobility of datum B of A|B(M): shift x", "plate.bore.mobility of datum B of A|B(M): shift y",
    ]  # fmt: skip
    worst = tc.analyses.worst_case(model)["worst"].sel(state="raw").values + 60
    np.testing.assert_allclose(worst, [[-0.15, 0.15]] * 2, atol=1e-7)
    _, still = simulate(bored(tc.Position(0.1, "A|B"), "ASME"), samples=8000, solver="daqp")
    alone = still["measured"][:, CORRECTED, 0].var()
    # 99.73 % of a normal distribution in a plane lie within 3.44 sigma; half of the size's departure is the radius.
    departure = scipy.stats.uniform(0, 0.2)
    play = (departure.var() + departure.mean() ** 2) / 4 / scipy.stats.chi(2).ppf(0.9973002) ** 2
    variance = run["measured"][:, CORRECTED, 0].var()
    assert variance == pytest.approx(alone + play, rel=4 * np.sqrt(2 * 1.5 / 20_000))


@pytest.mark.parametrize(
    ("datums", "standard", "own", "mated", "found"),
    [
        *nightly(("A|B(M)", "ISO", (), False, 0.15), ("A|B(L)", "ASME", (), False, 0.15)),
        ("A|B", "ASME", (), False, 0.05),
        ("A|B(M)", "", (), False, 0.05),
        ("A|B(M)", "ASME", (), True, 0.05),
        # virtual condition, and its own tilt
        *nightly(("A|B(M)", "ASME", (tc.Perpendicularity(0.04, "A"),), False, 0.15 + 0.02 + 0.02)),
    ],
)
def test_the_play_is_there_with_a_standard_and_without_a_mate(datums, standard, own, mated, found):
    worst = tc.analyses.worst_case(bored(tc.Position(0.1, datums), standard, *own, mated=mated))["worst"].sel(state="raw")
    np.testing.assert_allclose(worst.values[:2].max() + 60, found, atol=1e-6)


@pytest.mark.parametrize(
    ("standard", "simultaneous", "shared"),
    [("ASME", None, True), ("ISO", None, False), *nightly(("ASME", False, False), ("ISO", True, True))],
)
def test_holes_share_the_gauge_of_a_datum_in_a_simultaneous_requirement(standard, simultaneous, shared):
    """Then the play moves both holes alike along x, and their distance has no share of it; else each has its own."""
    model = bored(tc.Position(1e-4, "A|B(M)|C", simultaneous=simultaneous), standard, holes=2)
    program, run = simulate(model, samples=2000, solver="daqp")
    play = [label for label in program.nominal.contributors if "mobility" in label]
    assert {label.split(".")[1] for label in play} == ({"bore"} if shared else {"hole 0", "hole 1"})
    first, second = run["measured"][:, CORRECTED, 0], run["measured"][:, CORRECTED, 2]
    assert first.std() > 0.01
    if shared:
        assert (first - second).std() < 1e-4
    else:  # both depend on the size of the bore, and are uncorrelated
        assert (first - second).var() == pytest.approx(first.var() + second.var(), rel=0.1)


def test_a_simultaneous_requirement_has_the_same_datums_however_they_are_spaced():
    for second, count in (("A | B(M) | C", 1), ("A|B(M)", 2), ("A|B(L)|C", 2)):
        model = bored((tc.Position(0.1, "A|B(M)|C"), tc.Position(0.1, second)), "ASME", holes=2)
        play = [label for label in tc.build(model).nominal.contributors if "mobility" in label]
        assert len({label.partition(":")[0] for label in play}) == count, second
