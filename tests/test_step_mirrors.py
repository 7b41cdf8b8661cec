"""Bodies that STEP files place mirrored, by an operator (ISO 10303-42): shapes, names of faces and PMI are mirrored, too."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.pmi_records import Annotated
from tests.shapes import shape
from tests.step_files import WEDGE, Step
from tests.test_features_from_pmi import COVER, DECLARED, drawing
from tolcontact.errors import ModelError
from tolcontact.geometry import preview

FACES = ("foot", "front", "slope", "side")
TURNED = trimesh.transformations.rotation_matrix(0.7, [1, 2, 3], [30.0, 10, 20])
MIRRORS = {
    "x": np.diag([-1.0, 1, 1, 1]),
    "y": np.diag([1.0, -1, 1, 1]),
    "z at 5": trimesh.transformations.reflection_matrix([0, 0, 5], [0, 0, 1]),
    "a turned plane": trimesh.transformations.reflection_matrix([3, 4, 5], [1, -2, 3]) @ TURNED,
}


CHAINS = {name: [mirror] for name, mirror in MIRRORS.items()} | {
    "two mirrors": [MIRRORS["x"], MIRRORS["a turned plane"]],
    "a mirror that is turned": [MIRRORS["x"], TURNED],
    "three mirrors": [MIRRORS["x"], MIRRORS["y"], MIRRORS["z at 5"]],
}  # transforms of assemblies, each in the next one


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    """A file with a wedge in its place, and its images by the chains; the last one but one scales by -1, the last is mapped."""
    made = Step()
    wedge, whole = made.product("wedge", [made.wedge(FACES)]), made.product("whole")
    made.place(wedge, whole, "original")
    for name, (*inner, last) in CHAINS.items():
        image = wedge
        for level, transform in enumerate(inner):
            outer = made.product(f"{name} {level}")
            made.place(image, outer, f"inner {level}", operator=made.operator(transform))
            image = outer
        made.place(image, whole, name, operator=made.operator(last))
    made.place(wedge, whole, "as the kernel writes it", operator=made.operator(-MIRRORS["z at 5"], "-1."))
    made.image(wedge, MIRRORS["a turned plane"])
    path = tmp_path_factory.mktemp("mirrors") / "wedges.step"
    path.write_text(str(made))
    return path


def sorted_rows(points):
    return np.array(sorted(np.round(points, 6).tolist())) + 0.0


def test_an_image_is_a_mirrored_shape_in_its_place(path):
    """Two mirrors are a rotation, and three a mirror."""
    original, *images = tc.io.parts_from(tc.Assembly("wedges"), path).values()
    own, bodies = sorted_rows(shape(original.geometry).vertices), tc.io.bodies_in(path)
    chains = [*CHAINS.values(), [MIRRORS["z at 5"]], [MIRRORS["a turned plane"]]]
    for image, body, chain in zip(images, bodies[1:], chains, strict=True):
        transform = np.linalg.multi_dot([np.eye(4), *reversed(chain)])
        mesh, seen = shape(image.geometry), preview(image)
        R = seen.rotation
        assert mesh.is_watertight and mesh.volume == pytest.approx(40 * 20 * 10 / 6) and np.linalg.det(R) == pytest.approx(1)
        expected = trimesh.transform_points(WEDGE, transform)
        np.testing.assert_allclose(sorted_rows(seen.vertices), sorted_rows(expected), atol=1e-6)
        np.testing.assert_allclose([body.lower, body.upper], [expected.min(axis=0), expected.max(axis=0)], atol=1e-6)
        assert (sorted_rows(mesh.vertices).tolist() == own.tolist()) == (np.linalg.det(transform) > 0)
        faces = {face.name: R @ face.direction for face in tc.io.faces_in(path, body.number)}
        slope = transform[:3, :3] @ [1 / 40, 1 / 20, 1 / 10]
        np.testing.assert_allclose(faces["slope"], slope / np.linalg.norm(slope), atol=1e-9)
        np.testing.assert_allclose(faces["foot"], transform[:3, :3] @ [0, 0, -1], atol=1e-9)


def test_pmi_of_a_mirrored_body_applies_to_its_mirrored_faces(tmp_path):
    """The image is declared like the original, with datum targets where the mirror takes them."""
    annotated, made = Annotated(COVER.read_text()), Step(99_000)
    drawing(annotated)
    made.image((5, 10), MIRRORS["z at 5"])
    annotated.text = annotated.text.replace("ENDSEC;\nEND-ISO", f"{made.records}ENDSEC;\nEND-ISO")
    path = annotated.write(tmp_path / "covers.stp")
    (image,) = tc.io.parts_from(tc.Assembly("covers"), path, fixed=True).values()
    assert not tc.io.features_from_pmi(image).undeclared
    assert sorted(map(str, image.toleranced)) == sorted(feature.replace("cover", "image") for feature in DECLARED)
    (targets,) = image.targets
    np.testing.assert_allclose([point.position for point in targets.points], [(-60, 40, 8), (-20, 70, 8), (-100, 5, 8)])


def test_operators_that_scale_or_lack_parameters_are_refused(path, tmp_path):
    text, changed = path.read_text(), tmp_path / "wedges.step"
    first = next(line for line in text.splitlines() if "OPERATOR_3D" in line)
    for old, new, fault in (("$,#", "2.,#", "places a body scaled"), ("3D('','','',", "3D('',", "other parameters than ISO")):
        changed.write_text(text.replace(first, first.replace(old, new)))
        with pytest.raises(ModelError, match=fault):
            tc.io.parts_from(tc.Assembly("wedges"), changed)


def test_axes_that_an_operator_leaves_out_are_square_to_the_others(tmp_path):
    made, path = Step(), tmp_path / "axes.step"
    wedge, whole = made.product("wedge", [made.wedge()]), made.product("whole")
    start, x, y, z = f"#{made.point((0, 0, 0))}", *(f"#{made.direction(axis)}" for axis in np.eye(3))

    def place(name, *axes):
        operator = made.add("CARTESIAN_TRANSFORMATION_OPERATOR_3D('','','',{},{},{},$,{})".format(*axes))
        made.place(wedge, whole, name, operator=operator)
        path.write_text(str(made))

    place("x along y", y, "$", start, z)
    place("z along x", "$", "$", start, x)
    boxes = [(body.lower, body.upper) for body in tc.io.bodies_in(path)]
    expected = [((-20, 0, 0), (0, 40, 10)), ((0, 0, 0), (10, 40, 20))]
    np.testing.assert_allclose(boxes, expected, atol=1e-6)
    place("parallel", x, y, start, x)
    with pytest.raises(ModelError, match="has parallel axes"):
        tc.io.parts_from(tc.Assembly("axes"), path)
