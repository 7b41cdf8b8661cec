"""Features and patterns that the PMI of a STEP file states: what is declared, and the reason for what is not."""

from collections.abc import Sequence

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.helpers import ROOT, call
from tests.pmi_records import Annotated
from tests.test_cad import COVER
from tolcontact.discretization import discretize
from tolcontact.errors import OptionError
from tolcontact.pmi import OF_DATUMS
from tolcontact.variation import Draws

ROUND = "cylindrical or circular"
END, SIDE, UNDER, TOP, FAR_SIDE, FAR_END = 1, 6, 5, 2, 7, 10  # numbers of faces of the cover
CORNERS, HOLE, SLOT, SLOT_ENDS = (3, 4, 8, 9), (11,), (12, 14), (13, 15)


def cover(annotate, path) -> tc.Part:
    """The cover with PMI, in an assembly of its own."""
    file = Annotated(COVER.read_text())
    annotate(file)
    return tc.Assembly("cover").part("cover", tc.Mesh(file.write(path / "cover.stp")), fixed=True)


def datums(file: Annotated) -> None:
    for letter, face in {"A": UNDER, "B": SIDE, "C": END}.items():
        file.datum(letter, face)


def drawing(file: Annotated) -> None:
    """Tolerances of each kind that features and patterns state."""
    datums(file)
    file.tolerance("flatness", 0.1, file.aspect(UNDER), "", f"GEOMETRIC_TOLERANCE_WITH_DEFINED_UNIT(#{file.length(25)})")
    hole, slot, corners = (file.aspect(*faces) for faces in (HOLE, SLOT, CORNERS))
    file.size(hole, 8.1, (0, 0.03))
    file.tolerance("position", 0.2, hole, "A|B(M)|C", zone=ROUND, modifier="M")
    file.size(corners, 6, (-0.05, 0.05), "radius")
    upper = file.tolerance("position", 0.5, corners, "A|B|C", zone=ROUND)
    file.composite(upper, file.tolerance("position", 0.1, corners, "A|B", zone=ROUND))
    file.size(slot, 8.1, (-0.05, 0.05), "width")
    file.tolerance("position", 0.3, slot, "A|B|C")
    file.datum("D", *SLOT_ENDS)
    file.targets("E", (60, 40, 8), (20, 70, 8), (100, 5, 8))
    unequal = f"UNEQUALLY_DISPOSED_GEOMETRIC_TOLERANCE(#{file.length(0.1)})"
    file.tolerance("surface_profile", 0.4, file.aspect(FAR_END), "A|B|C", unequal)
    file.tolerance("surface_profile", 0.3, file.aspect(FAR_SIDE), "E|D")


DECLARED = [
    "feature A of cover (datum A): cover B-rep face 5; flatness 0.1/25",
    "feature B of cover (datum B): cover B-rep face 6",
    "feature C of cover (datum C): cover B-rep face 1",
    "feature plane 2 of cover: cover B-rep face 2",
    "feature cylinder 13 of cover: cover B-rep face 13",
    "feature cylinder 15 of cover: cover B-rep face 15",
    "feature cylinder 11 of cover: cover B-rep face 11; size 8.1 +0.03 +0 mm; position 0.2 Ⓜ A B Ⓜ C",
    "feature slot 12 of cover: cover B-rep face 12, cover B-rep face 14; size 8.1 +0.05 -0.05 mm; position 0.3 A B C",
    "feature plane 10 of cover: cover B-rep face 10; profile 0.4 Ⓤ0.1 A B C",
    "feature plane 7 of cover: cover B-rep face 7; profile 0.3 E D",
    "pattern cylinders 3 of cover: 4 members; size 12 +0.1 -0.1 mm; position 0.5 A B C; position 0.1 A>< B><",
    "pattern D of cover (datum D): 2 members",
]  # fmt: skip
TARGETS = "datum E: targets cover.plane 2 (60, 40, 8), cover.plane 2 (20, 70, 8), cover.plane 2 (100, 5, 8)"


def spreads(part: tc.Part, **place: Sequence[float]) -> dict[str, float]:
    """The standard deviation of each contributor of a part, which may be moved, by its label."""
    model = tc.Assembly("spreads")
    moved = model.part(part.name, part.geometry, fixed=True, **place)
    tc.io.features_from_pmi(moved)
    return spreads_of(model)


def spreads_of(model: tc.Assembly) -> dict[str, float]:
    (part,) = model.parts
    if part.fixed is None:
        points = {"z1": (0, 0, 0), "z2": (100, 0, 0), "z3": (0, 50, 0), "y1": (0, 0, 0), "y2": (100, 0, 0), "x1": (0, 0, 0)}
        model.locate(part, [tc.Locator(name, point, name[0], 0.0) for name, point in points.items()])
    model.measure("origin", part.point(0, 0, 0), along="z")
    return {contributor.label: contributor.variance**0.5 for contributor in Draws(discretize(model)).contributors}


def test_tolerances_of_a_drawing_become_features_and_patterns(tmp_path):
    part = cover(drawing, tmp_path)
    declared = tc.io.features_from_pmi(part)
    assert sorted(map(str, part.toleranced)) == sorted(DECLARED) and part.toleranced != ()
    assert set(declared.features) == {*part.toleranced, *part.targets} and not declared.undeclared
    assert [str(targets) for targets in part.targets] == [TARGETS]
    names = {str(one.annotation).split(",")[0]: one.features for one in declared.annotations}
    assert names["4. position 0.1 mm (diameter"] == ("cylinders 3",) and names["datum E: 0 faces"] == ("E",)
    assert (
        str(declared)
        == "13 features, patterns and datum targets, which state 7 of 7 tolerances, 3 of 3 dimensions, 5 of 5 datums"
    )
    (unequal,) = next(feature for feature in part.features if feature.name == "plane 10").tolerances
    assert unequal.outside == pytest.approx(0.1)


def test_spreads_are_those_of_the_zones(tmp_path):
    """Closed forms of 99.73 % inside: an end of an axis t / 7.27, coordinates of a rectangle t / 11.77, a size t / 6.

    An end of an axis deviates by the sum of a shift and a tilt, which are equal.
    """
    spread = spreads(cover(drawing, tmp_path))
    assert spread["cover.cylinder 11.size"] == pytest.approx(0.03 / 6, rel=1e-4)
    axis = spread["cover.cylinder 11.shift x"]
    assert axis == spread["cover.cylinder 11.tilt y"] == pytest.approx(0.2 / 7.27 / 2**0.5, rel=2e-3)
    assert spread["cover.slot 12.offset"] == pytest.approx(0.3 / 11.77, rel=1e-3)
    assert spread["cover.plane 10.tilt y"] == pytest.approx(0.4 / 11.77, rel=1e-3)
    assert spread["cover.cylinders 3 2.size"] == pytest.approx(0.2 / 6, rel=1e-4)
    assert not any(label.startswith(("cover.A.", "cover.E.", "cover.D.")) for label in spread)


def test_a_part_that_is_turned_and_moved_has_the_same_spreads(tmp_path):
    part = cover(drawing, tmp_path)
    still = spreads(part)
    moved = spreads(part, at=(1000, -700, 300), rotation=Rotation.from_euler("xyz", (0.4, -1.1, 2.0)).as_rotvec())
    assert list(moved) == list(still) and np.array([*moved.values()]) == pytest.approx(np.array([*still.values()]), rel=1e-6)


def test_a_second_call_declares_nothing_twice(tmp_path):
    part = cover(drawing, tmp_path)
    tc.io.features_from_pmi(part)
    before = part.toleranced
    again = tc.io.features_from_pmi(part)
    assert part.toleranced == before and again.features == ()
    reasons = {str(one.annotation).split(":")[0]: one.reason for one in again.undeclared}
    assert len(reasons) == len(again.annotations)
    assert reasons["datum A"] == (
        'it shares a face with feature "A", so that would deviate twice; give all tolerances of a face to one feature'
    )
    assert reasons["datum D"] == "of its surfaces, cylinder 13, cylinder 15 could not be declared"
    assert reasons["datum E"] == "of its surfaces, plane 2 could not be declared"


def test_features_of_the_script_stay_and_can_be_datums(tmp_path):
    part = cover(drawing, tmp_path)
    part.feature("bottom", part.face(tc.select.Brep(UNDER)), tc.Flatness(0.02), datum="A")
    tc.io.features_from_pmi(part)
    assert [str(feature) for feature in part.toleranced if feature.datum == "A"] == [
        "feature bottom of cover (datum A): cover B-rep face 5; flatness 0.02"
    ]
    assert DECLARED[6] in map(str, part.toleranced)


def all_over(file):
    datums(file)
    file.tolerance("surface_profile", 1.0, file.add("PRODUCT_DEFINITION_SHAPE('','',#1)"), "A|B|C")


def circle(file):
    file.datum("A", UNDER)
    for letter, face, other in (("B", SIDE, "C"), ("C", END, "B")):
        file.datum(letter, face)
        file.letters.setdefault(other, 0)
    for face, system in ((SIDE, "A|C"), (END, "A|B")):
        file.tolerance("perpendicularity", 0.1, file.aspect(face), system)


def other_body(file):
    record = file.add("ADVANCED_FACE('',(),#1,.T.)")
    file.faces.append(record)
    file.tolerance("flatness", 0.1, file.aspect(len(file.faces)))
    file.tolerance("flatness", 0.1, file.aspect(TOP, len(file.faces)))


def of_one(kind, value, faces, system="", *entities, **options):
    def annotate(file):
        datums(file)
        file.tolerance(kind, value, file.aspect(*faces), system, *entities, **options)

    return annotate


def unequal(file):
    entity = f"UNEQUALLY_DISPOSED_GEOMETRIC_TOLERANCE(#{file.length(0.1)})"
    of_one("surface_profile", 0.4, HOLE, "A|B|C", entity)(file)


def nothing(file):
    file.datum("A")
    file.tolerance("perpendicularity", 0.1, file.aspect(SIDE), "A")


def bounded(file):
    """A bonus, and a wider zone that has none: it limits the bonus, which is not declared."""
    datums(file)
    file.size(file.aspect(*HOLE), 8.1, (0, 0.3))
    file.tolerance("position", 0.4, file.aspect(*HOLE), "A|B|C", zone=ROUND, modifier="M")
    file.tolerance("position", 0.6, file.aspect(*HOLE), "A|B|C", zone=ROUND)


def one_letter(file):
    file.datum("A", UNDER)
    file.datum("A", SIDE)
    file.tolerance("flatness", 0.1, file.aspect(SIDE))


def two_letters(file):
    file.datum("A", *SLOT_ENDS)
    file.datum("B", *SLOT_ENDS)


def sizes(file):
    file.size(file.aspect(*HOLE), 8.1)
    file.size(file.aspect(*HOLE), 9.0, (-0.1, 0.1))
    file.size(file.aspect(UNDER), 8.1, (-0.1, 0.1))
    file.size(file.aspect(), 8.1, (-0.1, 0.1))
    file.size(file.aspect(*CORNERS, UNDER), 12.0, (-0.1, 0.1))


def fits(file):
    file.fit(file.aspect(*HOLE), 8.1, "h", "6", "hole")
    file.fit(file.aspect(*HOLE), 8.1, "V", "7")
    file.fit(file.aspect(*HOLE), 8.1, "sliding", "")


@pytest.mark.parametrize(
    ("letters", "grade", "variance", "size"),
    [("G", "6", "hole", "8.1 +0.014 +0.005"), ("H7", "", "hole", "8.1 +0.015 +0"), ("JS", "7", "", "8.1 +0.0075 -0.0075")],
)
def test_a_fit_has_the_limits_of_its_class(letters, grade, variance, size, tmp_path):
    def annotate(file):
        file.fit(file.aspect(*HOLE), 8.1, letters, grade, variance)

    (feature,) = tc.io.features_from_pmi(cover(annotate, tmp_path)).features
    assert str(feature.tolerances[0]) == f"size {size} mm"


def test_limits_of_a_fit_are_about_the_nominal_size_of_the_drawing(tmp_path):
    """A shape is modelled at 8.1, and its drawing says 8.09 H7."""
    (feature,) = tc.io.features_from_pmi(cover(lambda file: file.fit(file.aspect(*HOLE), 8.09, "H", "7"), tmp_path)).features
    assert str(feature.tolerances[0]) == "size 8.1 +0.005 -0.01 mm"


@pytest.mark.parametrize(("word", "reads"), [("FREE_STATE", "A|B|C"), ("ORIENTATION", "A|B><|C"), ("TRANSLATION", None)])
def test_modifiers_of_datums_are_marks_or_reasons(word, reads, tmp_path):
    def annotate(file):
        datums(file)
        file.tolerance("position", 0.2, file.aspect(*HOLE), f"A|B({word})|C", zone=ROUND)

    declared = tc.io.features_from_pmi(cover(annotate, tmp_path))
    stated = [tolerance.datums for feature in declared.features for tolerance in feature.geometric]
    assert stated == ([] if reads is None else [reads])
    assert [outcome.reason for outcome in declared.undeclared] == (
        ["datum B: its modifier, translation (▷, ASME Y14.5): " + OF_DATUMS["translation"].declared] if reads is None else []
    )


NO_SIZE = "sizes of features are those of cylinders, spheres and two opposed planes, and it is a plane"
REASONS = {
    "all over": (all_over, ["it is for all faces of the file; declare it for the faces that matter"]),
    "a circle of datums": (circle, ["datum C refers back to it"]),
    "another body": (other_body, ["none of its faces is on the part", "1 of its 2 faces are not on the part"]),
    "one letter for two datums": (one_letter, ["the part has a datum A already"]),
    "two letters for one datum": (two_letters, ["its surfaces are datum A already"]),
    "an unequal profile of a hole": (
        unequal, ["profile is for planes, if it says how much of it is outside, and it is a cylinder"],
    ),
    "a datum that nothing is": (nothing, ["the file states no face for it", "datum A is not declared"]),
    "a flat zone of an axis": (
        of_one("position", 0.2, HOLE, "A|B|C"), ["its zone is flat, and the file does not state across which direction"],
    ),
    "an orientation without datums": (
        of_one("perpendicularity", 0.2, (SIDE,)), ["it needs datums, and the file states none"],
    ),
    "a bonus without a size": (
        of_one("position", 0.2, HOLE, "A|B|C", zone=ROUND, modifier="M"),
        ["position: a bonus (material 'M') needs the tolerance of a size; add tc.Size(...)"],
    ),
    "a wider zone without the bonus": (bounded, ["position 0.6 controls nothing that others do not; leave one of them out"]),
    "fits": (
        fits,
        [
            "its fit h6 hole is for a shaft, and the feature is a hole",
            "ISO 286-1 does not define V7 for 8.1 mm: it is for sizes above 14 mm, up to 500 mm",
            "its fit sliding is no tolerance class of ISO 286-1",
        ],
    ),
    "sizes": (
        sizes,
        [
            "its limits are not stated", "its limits are 8.9 to 9.1, and the size of the shape is 8.1", NO_SIZE,
            "the file states no face for it", f"plane 5: {NO_SIZE}",
        ],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", REASONS)
def test_what_features_cannot_state_has_its_reason(name, tmp_path):
    annotate, reasons = REASONS[name]
    declared = tc.io.features_from_pmi(cover(annotate, tmp_path))
    assert [one.reason for one in declared.undeclared] == reasons


def test_a_narrower_tolerance_implies_the_same_with_more_width(tmp_path):
    def annotate(file):
        datums(file)
        for width in (0.6, 0.4, 0.4):
            file.tolerance("position", width, file.aspect(*HOLE), "A|B|C", zone=ROUND)

    declared = tc.io.features_from_pmi(cover(annotate, tmp_path))
    assert [str(tolerance) for feature in declared.features for tolerance in feature.geometric] == ["position 0.4 A B C"]
    assert [one.features for one in declared.annotations[-3:]] == [("cylinder 11",)] * 3 and not declared.undeclared


def test_the_free_state_is_declared_with_a_remark(tmp_path):
    declared = tc.io.features_from_pmi(cover(of_one("flatness", 0.1, (UNDER,), modifier="F"), tmp_path))
    remark = "it is for the part in its free state; here the part is rigid and stays so when it is assembled"
    assert [one.remark for one in declared.annotations if one.remark] == [remark] and not declared.undeclared
    assert f"flatness 0.1 mm (F), 1 faces: declared as A ({remark})" in str(declared)


def test_a_tolerance_of_several_surfaces_is_declared_in_part(tmp_path):
    part = cover(sizes, tmp_path)
    partly = tc.io.features_from_pmi(part).undeclared[-1]
    assert partly.features == ("cylinder 3", "cylinder 4", "cylinder 8", "cylinder 9")
    assert str(partly).endswith(f"declared as {', '.join(partly.features)} (plane 5: {NO_SIZE})")


def test_a_part_without_pmi_gets_one_message(tmp_path):
    model = tc.Assembly("model")
    empty = Annotated(COVER.read_text()).write(tmp_path / "empty.stp")
    parts = {
        'part "box" is a box 1 x 2 x 3 mm; only a STEP file of AP242 states PMI': tc.Box(1, 2, 3),
        'part "empty": its file states no tolerances, dimensions or datums as AP242 does': tc.Mesh(empty),
        'part "plain": its file states no tolerances, dimensions or datums as AP242 does': tc.Mesh(COVER),
        f'part "lost": "{tmp_path / "nowhere.stp"}" does not exist': tc.Mesh(tmp_path / "nowhere.stp"),
    }
    for message, geometry in parts.items():
        with pytest.raises(OptionError) as refused:
            tc.io.features_from_pmi(model.part(message.split('"')[1], geometry))
        assert message in str(refused.value) and str(refused.value).count("\n") == 0


def test_the_script_of_a_drawing_with_an_option_runs(tmp_path):
    """A tangent plane is an option that is true or false."""
    text = (ROOT / "tolcontact" / "guide" / "files" / "cover_pmi.stp").read_text()
    profile = "SURFACE_PROFILE_TOLERANCE()GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE((#90036))"
    tangent = "GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE((#90036))GEOMETRIC_TOLERANCE_WITH_MODIFIERS((.TANGENT_PLANE.))"
    text = text.replace(profile, f"{tangent}PERPENDICULARITY_TOLERANCE()")
    (tmp_path / "tangent.stp").write_text(text)
    script = call(tmp_path, "pmi", "tangent.stp", "--script").stdout
    assert "tangent=True" in script
    (tmp_path / "tangent.py").write_text(script)
    assert "NameError" not in call(tmp_path, "check", "tangent.py").stderr
