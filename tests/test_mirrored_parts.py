"""Mirror images of parts: equal deviations give mirrored assemblies, with and without contact."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.cases.elastic import beam, saved, stiffness
from tests.helpers import assembly_of, nightly, simulate
from tests.test_cad import COVER
from tests.test_json_models import written
from tolcontact.discretization import discretize
from tolcontact.errors import ModelError
from tolcontact.geometry import preview
from tolcontact.variation import Draws

TURN = (0.3, -0.2, 0.5)
SEATED = tc.Method(objective="seating")


def locators(*entries, **options):
    return [tc.Locator(name, point, direction, 0.3, **options) for name, point, direction in entries]


class Drawing:
    """A turned cover with the features of a drawing, on a plate that it touches."""

    tolerance = 1e-9

    def __init__(self, model, folder):
        plate = model.part("left plate", tc.Box(140, 100, 12), at=(-10, -10, -12), fixed=True)
        cover = model.part("left cover", tc.Mesh(COVER))
        face = {number: cover.face(tc.select.Brep(number)) for number in range(1, 16)}
        foot = cover.feature("A", face[5], tc.Flatness(0.1, form=None), datum="A")
        cover.feature("B", face[6], tc.Perpendicularity(0.2, "A"), datum="B")
        hole = tc.Size(8.1, 0.05), tc.Position(0.4, "A|B", material="M", cp=1.3, cpk=0.8)  # its mean is off centre
        cover.feature("hole", face[11], *hole, datum="H")
        composite = tc.Position(0.5, "A|B|H"), tc.Position(0.1, "A><|B><")
        cover.pattern("corners", face[3], face[4], face[8], face[9], tc.Size(12, 0.1), *composite)
        cover.feature("end", face[10], tc.Profile(0.4, "A|H"))
        feet = locators(("z1", (10, 10, 0), "z"), ("z2", (100, 10, 0), "z"), ("z3", (50, 70, 0), "z"))
        sides = locators(("y1", (10, 0, 4), "y"), ("y2", (100, 0, 4), "y"), ("x1", (0, 40, 4), "x"))
        model.locate(cover, [*feet, *sides], on=plate)
        model.contact("left seat", moving=foot, reference=plate.face("+z"), points=20)
        self.parts = plate, cover

    def measure(self, model, side, M, plate, cover):
        foot, _, hole, corners, end = cover.toleranced
        model.measure(f"{side} foot", foot.point(20, 60, 0), along=M @ (1, 2, 3))
        model.measure(f"{side} hole", hole.axis(1), along=M @ (1, 2, 0))
        for number, corner in enumerate(corners.members):
            model.measure(f"{side} corner {number}", corner.axis(0), along=M @ (1, 0.3, 0))
        model.measure(f"{side} distance", tc.AxisDistance(hole, corners.members[0], across=M @ (0, 0, 1)))
        model.measure(f"{side} end", end.point(120, 40, 4), to=plate.point(0, 0, 0), along=M @ (1, 0, 0))
        model.measure(f"{side} tilt", tc.Angle(cover.face("+z"), plate.face("+z")))


class Fastened:
    """A turned ring, which a pin that a force pushes holds on a block; faces are chosen by nearness, boxes and functions."""

    tolerance = 1e-9

    def __init__(self, model, folder):
        block = model.part("left block", tc.Box(60, 50, 10), at=(-20, -30, -10), fixed=True)
        annulus = tc.Mesh(trimesh.creation.annulus(5, 15, 8, sections=48))
        ring = model.part("left ring", annulus, at=(0, 0, 4), rotation=(0, 0, 0.4))
        ring.feature("bore", ring.face(tc.select.Cylinder(5, inner=True)), tc.Size(10, 0.1, 0.02))
        pin = model.part("left pin", tc.Pin(9.9, 20), at=(0, 0, 12), fixed=True)
        supports = locators(("s1", (12, 0, -4), "z"), ("s2", (-6, 11, -4), "z"), ("s3", (-6, -11, -4), "z"), one_sided=True)
        model.locate(ring, [*supports, *locators(("turn", (12, 0, 0), "y"))], floating=True)
        shank = pin.face(lambda centres, normals: np.abs(normals[:, 2]) < 0.5)
        model.contact("left bore", moving=ring.features[0], reference=shank)
        near = ring.face("-z", tc.select.Near(block, 1), tc.select.Inside((-20, -20, -5), (20, 20, 0)))
        model.contact("left seat", moving=near, reference=block.face("+z"), points=20)
        model.force("left push", at=ring.point(3, 2, 0), vector=(6, 3, -20))
        model.may_overlap(pin, block)
        self.parts = block, ring, pin

    def measure(self, model, side, M, block, ring, pin):
        for number, direction in enumerate(np.eye(3)):
            model.measure(f"{side} {number}", ring.point(10, 4, 3), along=M @ direction)


class Formed:
    """Boxes whose faces have form: contact is searched on splines, along axes that a mirror turns over."""

    tolerance = 1e-5

    def __init__(self, model, folder):
        base = model.part("left base", tc.Box(100, 50, 10), rotation=TURN)
        top = model.part("left top", tc.Box(50, 25, 10), at=placed(base, (30, 12, 10)), rotation=TURN)
        for part, side in ((base, "+z"), (top, "-z")):
            part.feature("seat", part.face(side), tc.Flatness(0.1, form=tc.Form(modes=3)), datum="A")
        top.feature("back", top.face("+z"), tc.Parallelism(0.2, "A"))
        for part in (base, top):
            model.locate(part, tc.three_two_one(part.face("-z"), part.face("-y"), part.face("-x"), inset=3), tolerance=0.3)
        model.contact("left seat", moving=top.features[0], reference=base.features[0])
        self.parts = base, top

    def measure(self, model, side, M, base, top):
        model.measure(f"{side} corner", top.features[1].point(50, 0, 10), along=M @ (1, 2, 3))
        model.measure(f"{side} seat", base.features[0].point(20, 10, 10), along=M @ (3, 2, 1))


class Bent:
    """A turned elastic beam, whose stiffness comes from a file, on more supports than it needs, under an oblique force."""

    tolerance = 1e-9

    def __init__(self, model, folder):
        stations = (0.0, 100.0, 200.0, 300.0)
        nodes, bends = beam(400.0, 20.0, stations)
        part = model.part("left beam", tc.Box(300, 20, 10), rotation=TURN)
        part.elastic(**saved(folder, "beam", nodes, stiffness(nodes, bends, [[3.0, 1.0], [1.0, 5.0]])))
        feet = locators(*((f"A{k}", node, "z") for k, node in enumerate(nodes)), one_sided=True)
        model.locate(part, [*feet, *locators(("B0", (0, 0, 0), "y"), ("B1", (300, 0, 0), "y"), ("C", (0, 20, 0), "x"))])
        model.force("left push", at=part.point(200, 0, 0), vector=(-6, 12, -30))
        self.parts = (part,)

    def measure(self, model, side, M, part):
        for number, point in enumerate(((100, 0, 0), (200, 20, 0))):
            model.measure(f"{side} {number}", part.point(*point), along=M @ (1, 2, 3))


def placed(part, point):
    return preview(part).rotation @ point + part.at


def twins(group, plane, folder):
    """A model with a group of parts and its image, which have the same deviations."""
    model = tc.Assembly("twins")
    own = group(model, folder)
    images = model.mirrored(*own.parts, plane=plane, at=-200, names=("left", "right"))
    images = images if isinstance(images, tuple) else (images,)
    own.measure(model, "left", np.eye(3), *own.parts)
    own.measure(model, "right", np.diag([-1.0 if axis == plane else 1.0 for axis in "xyz"]), *images)
    freedoms = {freedom.label: freedom for freedom in Draws(discretize(model)).contributors if freedom.source != "datum"}
    left = [label for label in freedoms if label.startswith("left")]
    right = [label.replace("left", "right") for label in left]
    assert sorted([*left, *right]) == sorted(freedoms)
    rng = np.random.default_rng(1)
    for label, image in zip(left, right, strict=True):
        assert (freedoms[label].variance, freedoms[label].mean_shift) == (freedoms[image].variance, freedoms[image].mean_shift)
    rows = [freedoms[label].deviations(rng.uniform(0.001, 0.999, 8)) for label in left]
    model.population(dict(zip(left, rows, strict=True)) | dict(zip(right, rows, strict=True)))
    return model


@pytest.mark.parametrize(
    ("group", "plane"),
    [
        *((Drawing, "x"), (Fastened, "y"), (Formed, "z"), (Bent, "x")),
        *nightly((Drawing, "z"), (Fastened, "x"), (Formed, "y"), (Bent, "y")),
    ],
)
def test_equal_deviations_give_mirrored_measures(group, plane, tmp_path):
    method = SEATED if group in (Fastened, Bent) else None
    _, run = simulate(twins(group, plane, tmp_path), samples=6, method=method)
    left, right = np.split(run["measured"], 2, axis=2)
    assert (run["status"] == 1).any() and np.abs(left[:, 1] - left[:, 0]).max() > 1e-3
    np.testing.assert_allclose(right[:, 0], left[:, 0], atol=1e-9)
    np.testing.assert_allclose(right[:, 1], left[:, 1], atol=group.tolerance)


def doors():
    """A door, hung on a body by a pin in a hole of each, and what belongs to it."""
    model = tc.Assembly("car")
    body = model.part("body", tc.Box(100, 50, 10), at=(-50, 0, -20), fixed=True)
    hinge = model.part("left hinge", tc.Box(10, 10, 10), at=(30, 0, -10), fixed=True)
    door = model.part("left door", tc.Box(30, 5, 40), at=(20, 0, 5), rotation=TURN)
    seat = hinge.feature("seat", hinge.face("+z"), tc.Flatness(0.1, form=None), datum="A")
    foot = door.feature("foot", door.face("-z"), tc.Flatness(0.1, form=None), datum="A")
    door.datum_targets("T", foot.point(1, 1, 0), foot.point(20, 1, 0), foot.point(5, 4, 0))
    model.locate(door, [tc.Locator("z", foot.point(3, 3, 0), "z", 0.1)], on=seat, floating=True)
    model.contact("left foot", moving=foot, reference=seat)
    model.contact("seal", moving=door.face("-y"), reference=body.face("+z"))
    model.force("weight", at=door.point(15, 2, 20), vector=(1, 2, -30))
    model.may_overlap(door, hinge, body)
    return model, hinge, door


def test_what_belongs_to_mirrored_parts_comes_with_them():
    model, hinge, door = doors()
    other_hinge, other = model.mirrored(hinge, door, plane="x", names=("left", "right"), at=5)
    assert model.pairs[-1].name == "right foot" and len(model.pairs) == 3  # the seal is with a part that is not mirrored
    assert model.pairs[-1].reference.part is other_hinge and model.overlaps[-1].parts == (other, other_hinge)
    location = model.locations[-1]
    assert (location.part, location.on, location.locators[0].on) == (other, other_hinge.features[0], other.features[0])
    assert location.locators[0].point == (3, 3, 0) and other.targets[0].features == other.features
    assert model.forces[-1].name == "weight right" and model.forces[-1].vector == (-1, 2, -30)
    assert other_hinge.fixed and not model.measures
    for point in ((0, 0, 0), (30, 5, 40)):
        np.testing.assert_allclose(placed(other, point), placed(door, point) * (-1, 1, 1) + (10, 0, 0), atol=1e-12)
    rear = model.mirrored(other, plane="y", names=("right", "rear"))  # two mirrors are half a turn; its hinge has no image
    np.testing.assert_allclose(placed(rear, (1, 2, 3)), placed(other, (1, 2, 3)) * (1, -1, 1), atol=1e-12)
    assert not rear.mirror and model.location_of(rear) is None and len(model.pairs) == 3


def test_a_model_with_mirrored_parts_is_the_same_as_data(tmp_path):
    model = tc.Assembly("one")
    part = model.part("left", tc.Box(10, 20, 30), rotation=TURN, fixed=True)
    part.feature("top", part.face("+z"), tc.Flatness(0.1), datum="A")
    image = model.mirrored(part, plane="z", names=("left", "right"))
    model.measure("corner", image.features[0].point(1, 2, 30), along="x")
    document = written(model, tmp_path / "one.json")
    assert [part.get("mirror") for part in document["parts"]] == [None, "z"]
    again = assembly_of(tmp_path / "one.json")
    assert str(again) == str(model) and placed(again.parts[1], (1, 2, 3)) == pytest.approx(placed(image, (1, 2, 3)))


@pytest.mark.parametrize(
    ("arguments", "fault"),
    [
        ({"plane": "left"}, 'plane is \'left\'; expected the axis that is normal to it, "x", "y" or "z"'),
        ({"names": "left"}, "names is 'left'; expected two different texts"),
        ({"at": "0"}, "at is '0'; expected a coordinate in mm"),
    ],
)
def test_wrong_arguments_are_refused(arguments, fault):
    model, _, door = doors()
    with pytest.raises(ValueError, match=fault):
        model.mirrored(door, **{"plane": "x", "names": ("left", "right")} | arguments)
    with pytest.raises(ValueError, match='part "left door" is no part of "other"'):
        tc.Assembly("other").mirrored(door, plane="x", names=("left", "right"))
    with pytest.raises(TypeError, match="expected parts"):
        model.mirrored("left door", plane="x", names=("left", "right"))
    with pytest.raises(ModelError, match="mirror is 'w'; expected one of"):
        part = tc.Assembly("part")
        part.part("part", tc.Box(1, 1, 1), mirror="w")
        tc.build(part)
