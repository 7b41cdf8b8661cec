"""Features that cannot be: one message each, which names part, feature and line, and says what to do."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.cases import toleranced
from tests.cases.round_contact import BARREL

BORE = tc.select.Cylinder(inner=True)


def ring(declare):
    a = tc.Assembly("ring")
    part = a.part("ring", tc.Mesh(trimesh.creation.annulus(5, 20, 30, sections=48)), fixed=True)
    part.feature("bottom", part.face("-z"), datum="A")
    part.feature("rim", part.face(BARREL), datum="B")
    a.measure("x", part.point(0, 0, 0), along="x")
    declare(part)
    return a


CASES = {
    "no width": (lambda p: p.feature("f", p.face("+z"), tc.Profile(0, "A")), "width is 0; expected the full width of the zone"),
    "a text for a width": (lambda p: p.feature("f", p.face("+z"), tc.Profile("1", "A"), tc.Flatness(0.1)), "width is '1'"),
    "a number for datums": (lambda p: p.feature("f", p.face("+z"), tc.Profile(1, 2)), "datums is 2"),
    "no number for a limit": (lambda p: p.feature("f", p.face(BORE), tc.Size(10, None)), "upper is None; expected a number"),
    "negative width": (lambda p: p.feature("f", p.face("+z"), tc.Profile(-1, "A")), "width is -1"),
    "bonus without a size": (
        lambda p: p.feature("f", p.face(BORE), tc.Position(0.1, "A|B", material="M")), "needs the tolerance of a size"
    ),
    "no such datum": (
        lambda p: p.feature("f", p.face("+z"), tc.Profile(0.1, "A|D")), "refers to datum D, which no feature of the part is"
    ),
    "no datums": (lambda p: p.feature("f", p.face(BORE), tc.Position(0.1)), 'needs datums; give them as in tc.Position(0.1'),
    "what datums do not lock": (
        lambda p: p.feature("f", p.face("+z"), tc.Perpendicularity(0.1, "A")), None  # it is parallel: its tilts are locked
    ),
    "twice the same": (
        lambda p: p.feature("f", p.face("+z"), tc.Profile(0.2, "A"), tc.Position(0.3, "A")), "controls nothing that others do"
    ),
    "orientation wider than location": (
        lambda p: p.feature("f", p.face("+z"), tc.Profile(0.1, "A"), tc.Parallelism(0.2, "A")),
        "profile 0.1 is narrower than parallelism 0.2, which it contains",
    ),
    "form wider than location": (
        lambda p: p.feature("f", p.face("+z"), tc.Profile(0.1, "A"), tc.Flatness(0.2)), "flatness 0.2 is wider than profile 0.1"
    ),
    "straightness wider than location": (
        lambda p: p.feature("f", p.face(BORE), tc.Position(0.1, "A|B"), tc.Straightness(0.2)), "which contains it"
    ),
    "roundness wider than the zone of an axis": (
        lambda p: p.feature(
            "f", p.face(BORE), tc.Position(0.1, "A|B"), tc.Roundness(0.2, form=None), tc.Cylindricity(0.3, form=None)
        ), None
    ),
    "roundness wider than profile": (
        lambda p: p.feature("f", p.face(BORE), tc.Profile(0.1, "A|B"), tc.Roundness(0.2)), "roundness 0.2 is wider than profile"
    ),
    "cylindricity of a plane": (lambda p: p.feature("f", p.face("+z"), tc.Cylindricity(0.1)), "cylindricity is for cylinders"),
    "limits the wrong way round": (
        lambda p: p.feature("f", p.face(BORE), tc.Size(10, -0.1, 0.1)), "the lower limit +0.1 is not below the upper one -0.1"
    ),
    "two surfaces": (lambda p: p.feature("f", p.face(tc.select.Cylinder())), "shares a face with feature"),
    "plane and cylinder": (
        lambda p: p.feature("f", p.face(lambda c, n: (n[:, 2] > 0.9) | (np.hypot(c[:, 0], c[:, 1]) < 6))),
        "spans more than one surface",
    ),
    "size of a plane": (lambda p: p.feature("f", p.face("+z"), tc.Size(30, 0.1)), "a size is for cylinders, spheres and two"),
    "another size": (lambda p: p.feature("f", p.face(BORE), tc.Size(10.2, 0.1)), "its size is 10 mm as shaped, and 10.2 mm"),
    "coaxiality of a plane": (lambda p: p.feature("f", p.face("+z"), tc.Coaxiality(0.1, "B")), "coaxiality is for cylinders"),
    "flatness of a cylinder": (lambda p: p.feature("f", p.face(BORE), tc.Flatness(0.1)), "flatness is for planes"),
    "not opposed": (
        lambda p: p.feature("f", p.face("+z"), p.face(BORE), tc.Size(10, 0.1)), "expected two planes that are opposed"
    ),
    "a zone along the axis": (
        lambda p: p.feature("f", p.face(BORE), tc.Position(0.1, "A|B", zone="flat", along="z")), "is not across its axis"
    ),
    "projected out of a cylinder": (
        lambda p: p.feature("f", p.face(BORE), tc.Position(0.1, "B|A", projected=10)), "a projected zone needs a plane"
    ),
    "unknown rule": (lambda p: p.feature("f", p.face("+z"), tc.Profile(0.1, "A", rule="wide")), "rule is 'wide'; expected one"),
    "translation of what only tilts": (
        lambda p: p.feature("f", p.face("+z"), tc.Parallelism(0.1, "A", rule="translation")), "leaves nothing"
    ),
    "face of another part": (
        lambda p: p.feature("f", tc.Assembly("x").part("other", tc.Box(1, 1, 1)).face("+z")), 'belongs to part "other"'
    ),
    "no face": (lambda p: p.feature("f", tc.Size(10, 0.1)), "it has 0 faces; expected one, or two that are opposed"),
    "letter": (lambda p: p.feature("f", p.face("+z"), datum="first"), "its datum letter is 'first'"),
    "letter twice": (lambda p: p.feature("f", p.face("+z"), datum="A"), 'datum "A" is declared 2 times'),
    "name twice": (lambda p: p.feature("rim", p.face("+z")), 'feature "rim" is declared 2 times'),
    "option of another kind": (
        lambda p: p.feature("f", p.face("+z"), tc.Parallelism(0.1, "A", projected=3)), "projected is given, which parallelism"
    ),
    "capable of nothing": (lambda p: p.feature("f", p.face("+z"), tc.Profile(0.1, "A", cp=1, cpk=2)), "cpk is 2"),
    "outside of its zone": (lambda p: p.feature("f", p.face("+z"), tc.Profile(0.1, "A", outside=0.2)), "outside is 0.2"),
    "a narrower one that fills it": (
        lambda p: p.feature("f", p.face(BORE), tc.Position(0.2, "A|B", projected=40), tc.Perpendicularity(0.1, "A")),
        "leave 17 % of the features outside already",
    ),
    "flatness per nothing": (
        lambda p: p.feature("f", p.face("+z"), tc.Flatness(0.1, per=(25, 0))), "per is (25, 0); expected a length in mm above 0"
    ),
    "roundness per length": (
        lambda p: p.feature("f", p.face(BORE), tc.Roundness(0.1, per=10)), "per is given, which roundness does not have"
    ),
    "tangent plane of an axis": (
        lambda p: p.feature("f", p.face(BORE), tc.Position(0.1, "A|B", tangent=True)), "position: tangent is for planes"
    ),
    "tangent and no truth value": (
        lambda p: p.feature("f", p.face("+z"), tc.Parallelism(0.1, "A", tangent="yes")), "tangent is 'yes'; expected True"
    ),
    "form beside a tangent plane": (
        lambda p: p.feature("f", p.face("+z"), tc.Parallelism(0.1, "A", tangent=True), tc.Flatness(0.2)), None
    ),
    "outside of a cylinder": (
        lambda p: p.feature("f", p.face(BORE), tc.Profile(0.2, "A|B", outside=0.1)), "how much of it is outside"
    ),
    "a flat zone of a plane": (
        lambda p: p.feature("f", p.face("+z"), tc.Position(0.1, "A", zone="flat", along="x")), "are for axes; leave them out"
    ),
    "a middle that stands still": (
        lambda p: p.feature("f", p.face("+z"), p.face("-z"), tc.Size(30, 0.1, moves="first"), tc.Symmetry(0.1, "B")),
        "has no middle that could have a place",
    ),
    "bonus alone, around another tolerance": (
        lambda p: p.feature(
            "f", p.face(BORE), tc.Size(10, 0.1), tc.Position(0, "A|B", material="M"), tc.Perpendicularity(0.1, "A")
        ),
        "a zone of width 0 is its bonus alone",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", CASES)
def test_it_has_one_message(name):
    declare, said = CASES[name]
    faults = tc.check(ring(declare))
    if said is None:
        assert not faults
    else:
        (fault,) = faults
        assert said in fault and 'part "ring"' in fault


@pytest.mark.parametrize("tolerance", [tc.Size(10, 0.1), tc.Position(0.1, "A"), tc.Coaxiality(0.1, "A")])
def test_how_far_a_face_is_off_the_nearest_simple_one_is_said(tolerance):
    shape = trimesh.creation.annulus(5, 9, 20, sections=180)
    shape.vertices[:, 0] *= 1.01  # an oval hole: 5.05 by 5
    a = tc.Assembly("oval")
    part = a.part("ring", tc.Mesh(shape), fixed=True)
    part.feature("under", part.face("-z"), datum="A")
    part.feature("hole", part.face(lambda c, n: np.linalg.norm(c[:, :2], axis=1) < 6), tolerance)
    a.measure("height", part.point(0, 0, 20), along="z")
    (fault,) = tc.check(a)
    assert "a general surface (the nearest cylinder is off by up to 0.025 mm, more than 0.001)" in fault


def test_a_datum_that_locks_nothing_is_named():
    a = toleranced.ball_with(letter="S")
    part = a.parts[0]
    part.feature("over", part.face("+x", lambda c, n: abs(c[:, 0] - 20) < 1e-9), tc.Parallelism(0.1, "S"))
    (fault,) = [each for each in tc.check(a) if "lock" in each]
    assert "parallelism: the datum system S does not lock any of what is toleranced; add the datum that does" in fault


def test_a_datum_that_could_not_be_made_is_named():
    a = tc.Assembly("block")
    block = a.part("block", tc.Box(10, 10, 10), fixed=True)
    block.feature("foot", block.face("-z"), tc.Size(10, 0.1), datum="A")
    block.feature("top", block.face("+z"), tc.Profile(0.1, "A"))
    a.measure("height", block.point(0, 0, 10), along="z")
    foot, top = tc.check(a)
    assert "a size is for cylinders" in foot
    assert 'feature "top"' in top and "profile refers to datum A, which could not be made; mend its feature first" in top


def test_datums_that_refer_to_each_other_are_named():
    def circle(p):
        p.feature("one", p.face("+z"), tc.Parallelism(0.1, "D"), datum="C")
        p.feature("two", p.face(BORE), tc.Perpendicularity(0.1, "C"), datum="D")

    (fault,) = tc.check(ring(circle))
    assert 'features "one", "two": their datums refer to each other in a circle' in fault


def test_a_pair_may_not_be_partly_of_a_feature():
    a = tc.Assembly("partly")
    base = a.part("base", tc.Box(60, 40, 10), fixed=True)
    base.feature("under", base.face("-z"), datum="A")
    base.feature("top", base.face("+z"), tc.Profile(0.2, "A"))
    block = a.part("block", tc.Box(20, 20, 10), at=(10, 10, 10))
    a.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=0.1)
    a.contact("seat", moving=block.face("-z"), reference=base.face())
    a.measure("x", block.point(0, 0, 0), along="x")
    (fault,) = tc.check(a)
    assert 'contact pair "seat"' in fault and 'is partly that of feature "top"' in fault


def test_a_feature_of_two_faces_is_no_face():
    a = tc.Assembly("tab")
    tab = a.part("tab", tc.Box(10, 4, 6), fixed=True)
    width = tab.feature("width", tab.face("+y"), tab.face("-y"), tc.Size(4, 0.1))
    with pytest.raises(TypeError, match=r'feature "width" has 2 faces; choose one of them: .faces\[0\]'):
        a.contact("side", moving=width, reference=tab.face())
    with pytest.raises(TypeError, match=r'feature "odd": float is neither a face nor a tolerance'):
        tab.feature("odd", tab.face("+x"), 0.1)


def test_locators_stand_on_features_of_their_own_part():
    a = tc.Assembly("strange")
    base, block = a.part("base", tc.Box(9, 9, 9), fixed=True), a.part("block", tc.Box(9, 9, 9))
    top = base.feature("top", base.face("+z"))
    six = [((0, 0, 0), "z"), ((9, 0, 0), "z"), ((0, 9, 0), "z"), ((0, 0, 0), "y"), ((9, 0, 0), "y"), ((0, 0, 0), "x")]
    a.locate(block, [tc.Locator(f"L{k}", p, d, 0, on=top if k == 2 else None) for k, (p, d) in enumerate(six)])
    a.measure("x", block.point(0, 0, 0), along="x")
    (fault,) = tc.check(a)
    assert 'locator "L2" is on feature "top" of part "base"' in fault
