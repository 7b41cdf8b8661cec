"""Bodies that meet in several pairs of faces, some of which deviate."""

import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc


def corner(order, rotation):
    """A block in the corner of an angle, whose wall tilts and whose floor does not; contact is declared in an order."""
    a, R = tc.Assembly("corner"), Rotation.from_rotvec(rotation).as_matrix()
    floor, wall = (trimesh.creation.box(bounds=bounds) for bounds in ([[0, 0, -10], [60, 60, 0]], [[0, -10, -10], [60, 0, 20]]))
    angle = a.part("angle", tc.Mesh(trimesh.boolean.union([floor, wall], engine="manifold")), fixed=True, rotation=rotation)
    block = a.part("block", tc.Box(40, 30, 15), at=R @ (10, 0, 0), rotation=rotation)
    angle.feature("A", angle.face("-z"), datum="A")
    angle.feature("B", angle.face("-y"), datum="B")
    inner = [angle.face(side, lambda c, n, axis=axis: abs(c[:, axis]) < 1e-6) for side, axis in (("+y", 1), ("+z", 2))]
    inner[0] = angle.feature("wall", inner[0], tc.Profile(0.4, "A|B"))
    scheme = tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=2)
    a.locate(block, scheme, tolerance=0.4)
    for number in order:
        a.contact(("wall", "floor")[number], moving=block.face(("-y", "-z")[number]), reference=inner[number])
    for k, (x, z) in enumerate(((0, 0), (60, 0), (0, 20))):
        a.measure(f"wall {k}", inner[0].point(x, 0, z), along=R[:, 1])
    return a


def tab_in_a_slot():
    """A tab on the floor of a slot, whose walls move with its size, as those of the tab do."""
    a = tc.Assembly("slot")
    block, cut = (trimesh.creation.box(bounds=bounds) for bounds in ([[0, 0, 0], [60, 50, 20]], [[-1, 20, 10], [61, 30, 21]]))
    body = a.part("body", tc.Mesh(trimesh.boolean.difference([block, cut], engine="manifold")), fixed=True)
    tab = a.part("tab", tc.Box(40, 10, 15), at=(10, 20, 10))
    walls = [body.face(side, lambda c, n, at=at: abs(c[:, 1] - at) < 1e-6) for side, at in (("+y", 20), ("-y", 30))]
    walls = body.feature("slot", *walls, tc.Size(10, 0.2)).faces
    sides = tab.feature("tab", tab.face("-y"), tab.face("+y"), tc.Size(10, 0.0, -0.2)).faces
    a.locate(tab, tc.three_two_one(tab.face("-z"), sides[0], tab.face("-x"), inset=2), tolerance=0.2)
    for name, side, wall in zip(("near", "far"), sides, walls, strict=True):
        a.contact(name, moving=side, reference=wall)
    a.contact("floor", moving=tab.face("-z"), reference=body.face("+z", lambda c, n: abs(c[:, 2] - 10) < 1e-6))
    a.measure("across", tab.point(20, 5, 0), along="y")
    return a
