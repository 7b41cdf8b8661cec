"""Insides of `geometry` under the claims of `tests/test_stored_coordinates.py`."""

import numpy as np
import pytest
import trimesh

import tolcontact as tc
from tests.cases.stored import FAR, stored
from tests.shapes import shape
from tests.test_stored_coordinates import BOX
from tolcontact.geometry.inset import inset
from tolcontact.geometry.triangle_mesh import coordinate_error
from tolcontact.interference import Neighbours, solid
from tolcontact.poses import AT_REST


def test_the_test_of_interference_allows_the_error_and_no_more(tmp_path):
    lower, upper = (trimesh.creation.box(bounds=[(0, 0, z), (10, 10, z + 10)]).apply_translation(FAR) for z in (0, 10))
    solids = [solid(shape(stored(mesh, tmp_path / f"{name}.stl"))) for name, mesh in (("lower", lower), ("upper", upper))]
    error = sum(coordinate_error(shape(tc.Mesh(tmp_path / f"{name}.stl"))) for name in ("lower", "upper"))
    X_BA = np.repeat(AT_REST[None], 3, axis=0)
    X_BA[:, 11] = [0.0, 0.9 * error, 2.5 * error]
    assert Neighbours(*solids, insets=(4e-6, 6e-6), reach=1.0).interfere(X_BA).tolist() == [False, False, True]


def test_a_small_part_near_the_origin_has_next_to_no_error(tmp_path):
    block = trimesh.creation.box(bounds=[(0, 0, 0), (100, 50, 10)])
    part = shape(stored(block, tmp_path / "block.stl"))
    assert 2 * coordinate_error(part) < 1e-5
    assert coordinate_error(shape(tc.Box(100, 50, 10))) == 0


def test_a_body_is_smaller_by_its_error():
    error, rng = 1e-4, np.random.default_rng(1)
    rounded = trimesh.Trimesh(BOX.vertices + rng.uniform(-error, error, (8, 3)) / 3, BOX.faces, process=False)
    vertices = inset(rounded, error)
    middle = BOX.vertices.mean(axis=0)
    assert vertices == pytest.approx(BOX.vertices - error * np.sign(BOX.vertices - middle), abs=error / 2)
    flat = trimesh.Trimesh(vertices, BOX.faces, process=False)
    assert flat.face_adjacency_angles[BOX.face_adjacency_angles < 0.1].max() < 1e-7
