"""Shapes for tests: a block, a STEP file, and the faces that are picked from them."""

import pytest
import trimesh

import tolcontact as tc
from tests import cases
from tolcontact.errors import GeometryFault
from tolcontact.geometry.faces import patch, triangles
from tolcontact.geometry.shapes import shape

HOUSING = cases.MODELS / "housing.step"

BLOCK = trimesh.creation.box(bounds=[[0, 0, 0], [10, 20, 30]])


def face_of(mesh, *selections):
    part = tc.Assembly("faces").part("part", tc.Mesh(mesh))
    return patch(part.face(*selections), {part: shape(part.geometry)})


def triangles_of(face):
    """The numbers of the triangles of a face."""
    return triangles(face, {face.part: shape(face.part.geometry)})


def refusal(path, content=None):
    """What is said of a file, which may be made of some content first."""
    if content is not None:
        path.write_bytes(content.encode() if isinstance(content, str) else content)
    with pytest.raises(GeometryFault) as refused:
        shape(tc.Mesh(path))
    said = str(refused.value)
    assert path.name in said
    assert len(said) < 2500 and "\n" not in said
    return said
