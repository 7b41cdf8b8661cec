"""Distances of axes, and angles, against closed forms, rigid motions and least distances that are found otherwise."""

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases.measured import (
    PLANE,
    ROUND,
    axis_of,
    check_invariance,
    hole,
    motions,
    observed,
    placed,
    ring,
    segments_apart,
    shaft,
    two,
)
from tests.helpers import compiled


@pytest.mark.parametrize("turn", [0.3, 0.0, 1e-10, 1e-7, np.pi / 2])
def test_axes_are_as_far_apart_as_their_nearest_places(turn):
    assembly, first, second = two(shaft(), ring(), at=(20, 4, 9), rotation=(turn, 0, 0))
    faces = first.face(ROUND), hole(second)
    assembly.measure("shortest", tc.AxisDistance(*faces))
    assembly.measure("back", tc.AxisDistance(*reversed(faces)))
    for R, t in (motions(), motions(turn=1e-9), motions(turn=0)):
        expected = segments_apart(axis_of(first, R[:, 0], t[:, 0], 30), axis_of(second, R[:, 1], t[:, 1], 12))
        np.testing.assert_allclose(observed(assembly, R, t), np.column_stack([expected] * 2), atol=1e-6)
        check_invariance(assembly, R, t)


def test_axes_are_measured_in_a_plane_and_along_a_direction():
    assembly, first, second = two(ring(), ring(), at=(20, 4, 9), rotation=(0.1, 0.05, 0))
    n = np.array([0.2, -0.1, 0.9]) / np.linalg.norm([0.2, -0.1, 0.9])
    assembly.measure("across", tc.AxisDistance(hole(first), hole(second), across=n))
    assembly.measure("along", tc.AxisDistance(hole(first), hole(second), along=(3, 0, 4)))
    R, t = motions()
    (a, a_end), (b, b_end) = axis_of(first, R[:, 0], t[:, 0], 12), axis_of(second, R[:, 1], t[:, 1], 12)
    middle, v = (a + a_end) / 2, (b_end - b) / 12
    pierced = b + ((middle - b) @ n / (v @ n))[:, None] * v
    foot = b + ((middle - b) * v).sum(axis=1)[:, None] * v
    np.testing.assert_allclose((pierced - middle) @ n, 0, atol=1e-12)
    expected = np.column_stack([np.linalg.norm(pierced - middle, axis=1), (foot - middle) @ [0.6, 0, 0.8]])
    np.testing.assert_allclose(observed(assembly, R, t), expected, atol=1e-9)


def test_the_axis_of_a_sphere_is_its_centre():
    ball = tc.Mesh(trimesh.creation.icosphere(3, 4.0))
    assembly, first, second = two(ball, ball, at=(12, 5, 3), first_rotation=(0, 0, 0), first_at=(0, 0, 0))
    for options in ({}, {"across": "z"}, {"along": "y"}):
        assembly.measure(f"distance {options}", tc.AxisDistance(first.face(), second.face(), **options))
    R, t = motions(turn=0)
    v = t[:, 1] - t[:, 0] + [12, 5, 3]
    expected = np.column_stack([np.linalg.norm(v, axis=1), np.hypot(v[:, 0], v[:, 1]), v[:, 1]])
    np.testing.assert_allclose(observed(assembly, R, t), expected, atol=1e-6)


def test_small_angles_keep_their_digits():
    """The arc cosine of 1 - 5e-19 is 0, and that of 1 - 5e-17, too."""
    assembly, first, second = two(PLANE, PLANE, at=(0, 0, 10), first_rotation=(0, 0, 0))
    assembly.measure("angle", tc.Angle(first.face("+z"), second.face("-z")))
    assembly.measure("turn", tc.Angle(first.face("+z"), second.face("-z"), about="x"))
    angles = np.array([0, 1e-12, 1e-9, -1e-8, 3e-5, -0.01, 0.3])
    R = np.broadcast_to(np.eye(3), (len(angles), 2, 3, 3)).copy()
    R[:, 1] = Rotation.from_rotvec(angles[:, None] * [1, 0, 0]).as_matrix()
    found = observed(assembly, R, np.zeros((len(angles), 2, 3)))
    np.testing.assert_allclose(found, np.column_stack([np.abs(angles), angles]), rtol=1e-6, atol=1e-18)
    assert {measure.units for measure in assembly.measures} == {"rad"}


@pytest.mark.parametrize("turn", [0.0, 0.4, np.pi / 2, 2.0])
def test_angles_of_planes_and_axes(turn):
    assembly, first, second = two(PLANE, shaft(), at=(60, 0, 0), rotation=(0, turn, 0))
    assembly.measure("angle", tc.Angle(first.face("+z"), second.face(ROUND)))
    assembly.measure("in plane", tc.Angle(first.face("-z"), second.face(ROUND), about=(0, 1, 2)))
    R, t = motions()
    u = placed(first, R[:, 0], t[:, 0], [[0, 0, 1]], is_direction=True)[:, 0]
    v = placed(second, R[:, 1], t[:, 1], [[0, 0, 1]], is_direction=True)[:, 0]
    angle = np.arccos((u * v).sum(axis=1))
    found = observed(assembly, R, t)
    if turn == np.pi / 2:  # then the sense decides; that of an axis is its own
        np.testing.assert_allclose(np.abs(found[:, 0] - np.pi / 2), np.abs(angle - np.pi / 2), atol=1e-9)
    else:
        np.testing.assert_allclose(found[:, 0], angle if turn < np.pi / 2 else np.pi - angle, atol=1e-6)
    n = np.array([0, 1, 2]) / np.sqrt(5)
    flat = [w - (w @ n)[:, None] * n for w in (u, v)]
    azimuths = [np.arctan2(w @ np.cross(n, [1, 0, 0]), w @ [1, 0, 0]) for w in flat]
    difference = (azimuths[1] - azimuths[0] - found[:, 1] + np.pi / 2) % np.pi - np.pi / 2
    np.testing.assert_allclose(difference, 0, atol=1e-9)
    assert np.abs(compiled(assembly).nominal_measures).max() <= np.pi / 2 + 1e-9


@pytest.mark.parametrize("is_swapped", [False, True])
@pytest.mark.parametrize("turn", [(0, 0, 0), (0.4, -1.1, 0.7), (1, 2, 0.3)])
def test_a_right_angle_of_a_plane_and_an_axis_is_positive_in_any_frame(turn, is_swapped):
    """The sense of a fitted axis depends on the frame, and the angle about a direction does not."""
    frame = Rotation.from_rotvec(turn)
    model = tc.Assembly("square")
    box = model.part("box", tc.Box(10, 10, 10), rotation=turn, fixed=True)
    pin = model.part("pin", tc.Mesh(trimesh.creation.cylinder(5, 30)), at=frame.apply([20, 0, 0]), rotation=turn)
    points = {"X1": ((0, 0, 10), "x"), "X2": ((0, 0, -10), "x"), "Y1": ((0, 0, 10), "y"), "Y2": ((0, 0, -10), "y")}
    points |= {"Z": ((0, 0, -15), "z"), "T": ((5, 0, 0), "y")}
    model.locate(pin, [tc.Locator(name, point, along, 0.1) for name, (point, along) in points.items()])
    faces = (box.face("+x"), pin.face(ROUND))
    model.measure("angle", tc.Angle(*(reversed(faces) if is_swapped else faces), about=tuple(frame.apply([0, 1, 0]))))
    assert compiled(model).nominal_measures == pytest.approx([np.pi / 2], abs=1e-9)
