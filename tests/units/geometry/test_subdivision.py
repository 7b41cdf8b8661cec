"""Triangles are divided until their edges are short; nothing is lost, and neighbours keep their common corners."""

import numpy as np
import pytest
import trimesh

from tolcontact.geometry.triangle_mesh import subdivided

MESHES = {
    "box": trimesh.creation.box((100, 20, 3)),
    "slivers": trimesh.creation.annulus(3, 60, 2, sections=90),
    "ball": trimesh.creation.icosphere(2, radius=10),
}


@pytest.mark.parametrize("name", MESHES)
@pytest.mark.parametrize("max_edge", [1e3, 7.0, 1.3])
def test_pieces_have_short_edges_and_cover_the_triangles(name, max_edge):
    mesh = MESHES[name]
    vertices, faces, origin = subdivided(mesh.vertices, mesh.faces, max_edge)
    corners = vertices[faces]
    assert np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2).max() <= max_edge
    areas = trimesh.triangles.area(corners)
    assert np.bincount(origin, areas, len(mesh.faces)) == pytest.approx(mesh.area_faces, rel=1e-12)
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]) / (2 * areas[:, None])
    assert np.abs(normals - mesh.face_normals[origin]).max() < 1e-9
    assert trimesh.Trimesh(vertices, faces, process=False).is_watertight


def test_only_triangles_with_long_edges_are_divided():
    vertices = np.array([[0.0, 0, 0], [4, 0, 0], [0, 1, 0], [0, -1, 0], [-1, 0, 0]])
    _, faces, origin = subdivided(vertices, np.array([[0, 1, 2], [0, 2, 4]]), 3.0)
    assert list(np.bincount(origin)) == [3, 1]
    assert (faces[origin == 1] == [0, 2, 4]).all()
