"""Models that use every way to declare a thing."""

import trimesh
from scipy import stats

import tolcontact as tc
from tests.cases.locators import translating


def everything_of_meshes(folder) -> tc.Assembly:
    """Meshes, one of them of a file in `folder`, faces chosen by functions and numbers, frozen distributions, own measures."""
    wedge = trimesh.creation.box(bounds=[[0, 0, 0], [30, 20, 8]])
    wedge.export(folder / "block.stl")
    a = tc.Assembly("everything")
    base = a.part("base part", tc.Mesh(trimesh.creation.box(bounds=[[0, 0, 0], [60, 40, 10]])), fixed=True)
    block = a.part("block", tc.Mesh(folder / "block.stl"), at=(10, 10, 10), rotation=(0, 0, 0.1))
    frozen = {"Z": stats.gamma(2, scale=0.02, loc=-0.04), "Y2": stats.norm(0, 0.1)}
    scheme = [tc.Locator(one.name, one.point, one.direction, frozen.get(one.name, 0.5)) for one in translating(0)]
    a.locate(block, scheme)
    upward = base.face(lambda centres, normals: (normals[:, 2] > 0.9) & (centres[:, 2] > 9))
    a.contact("joint", moving=block.face("-z"), reference=upward, spacing=6.0, within=2.0)
    a.contact("corners", moving=block.face([*range(12)]), reference=base.face("+z"), points="vertices", within=1.0)
    a.measure("height", block.point(0, 0, 8), along=(0, 0.6, 0.8), tolerance=1)
    a.measure("gap", base.point(0, 0, 10), to=block.point(0, 0, 0), along="z")
    a.measure("tilt", lambda poses: poses.rotation(block)[2, 0] * 2 + 1, units="rad")
    return a


def everything_of_boxes() -> tc.Assembly:
    """What a document holds without meshes: part on part, a distribution, faces of several kinds, own measures, a force."""
    a = tc.Assembly("everything")
    base = a.part("base", tc.Box(100, 50, 10))
    top = a.part("top", tc.Box(50, 25, 10), at=(50, 12.5, 10))
    a.locate(base, tc.three_two_one(base.face("-z"), base.face("-y"), base.face("-x"), inset=5), tolerance=10)
    places = {"A1": ((5, 5, 0), "z"), "A2": ((45, 5, 0), "z"), "A3": ((25, 20, 0), "z"), "B1": ((5, 0, 5), "y")}
    places |= {"B2": ((45, 0, 5), "y"), "C": ((0, 10, 5), "x")}
    six = [tc.Locator(name, *place) for name, place in places.items()]
    a.locate(top, six, tolerance=stats.beta(2, b=3, loc=-0.5, scale=1), on=base)
    upper = base.face("+z", tc.select.Inside((0, 0, 9), (90, 50, 11)))
    a.contact("interface", moving=top.face(range(12)), reference=upper, points="vertices", within=2)
    a.measure("height", top.point(50, 0, 10), along="z", tolerance=1)
    a.measure("gap", base.point(0, 0, 10), to=top.point(0, 0, 0), along=(0, 0.6, 0.8))
    a.measure("tilt", lambda poses: poses.rotation(top)[2, 0] * 2 + 1, units="rad")
    a.force("push", at=top.point(0, 0, 0), vector=(1, 0, -2))
    return a
