"""Two supports on a plate, held by bolts in holes: extremes by hand."""

import trimesh

import tolcontact as tc
from tests.cases.floating import SEATED, flat_feet

LENGTH, ARM = 105.0, 27.5  # between the holes of the plate; from a support's hole to its face


def fasteners(is_fixed: bool, pull: float) -> tc.Assembly:
    """Supports whose bolts stand in a plate, firmly (threads) or with clearance too; forces `pull` the supports apart.

    Holes at least material: supports 11.5 and position 1.0 of fixed fasteners, else 11 in plate and supports, and 1.0 in both.
    """
    a = tc.Assembly("fasteners", method=SEATED)
    axes: dict[str, tuple[tc.declaration.Point, tc.declaration.Point]] = {}
    hole = 11.5 if is_fixed else 11.0
    of_plate = trimesh.creation.box(extents=(3 * LENGTH, 40, 4)).apply_translation((0, 0, -20))
    bolts = [
        (trimesh.creation.cylinder(5, 8) if is_fixed else trimesh.creation.annulus(hole / 2, 15, 8)).apply_translation(
            (x, 0, -4)
        )
        for x in (-LENGTH / 2, LENGTH / 2)
    ]
    plate = a.part("plate", tc.Mesh(trimesh.util.concatenate([of_plate, *bolts])), fixed=True)
    _datums(plate, -18.0, 1.4 * LENGTH)
    for name, side in (("left", -1.0), ("right", 1.0)):
        x = side * LENGTH / 2
        on_plate = plate.feature(
            f"{name} hole" if not is_fixed else f"{name} thread",
            plate.face(tc.select.Cylinder(inner=not is_fixed), lambda c, n, x=x: (abs(c[:, 0] - x) < 6) & (c[:, 2] > -10)),
            tc.Position(0.5 if is_fixed else 1.0, "A|B|C", rule="translation"),
        )
        ring = trimesh.creation.annulus(hole / 2, 15, 8).apply_translation((0, 0, 4))
        foot = trimesh.creation.box(extents=(2, 60, 4)).apply_translation((-side * ARM + side, 0, 20))
        support = a.part(name, tc.Mesh(trimesh.util.concatenate([ring, foot])), at=(x, 0, 0))
        face = support.face("-x" if side > 0 else "+x", lambda c, n: c[:, 2] > 15)
        support.feature("face", face, datum="C")
        support.feature("under", support.face("-z", lambda c, n: c[:, 2] > 15), datum="A")
        support.feature("end", support.face("-y", lambda c, n: c[:, 2] > 15), datum="B")
        bore = support.feature(
            "hole", support.face(tc.select.Cylinder(radius=hole / 2, inner=True)), tc.Position(1.0, "A|B|C", rule="translation")
        )
        axes[name] = on_plate.axis(0), bore.axis(0)
        held = [*flat_feet(0.0), tc.Locator("Y", (0, 0, 0), "y", 0), tc.Locator("turn", (15, 0, 0), "y", 0)]
        a.locate(support, held, floating=True)
        a.force(f"pull {name}", at=support.point(0, 0, 4), vector=(side * pull, 0, 0))
        if is_fixed:
            a.contact(f"{name} fit", moving=bore, reference=on_plate)
            continue
        bolt = a.part(f"{name} bolt", tc.Mesh(trimesh.creation.cylinder(5, 24)), at=(x, 0, 0))
        upright = [*flat_feet(-12.0), tc.Locator("Y", (0, 0, 0), "y", 0), tc.Locator("turn", (5, 0, 0), "y", 0)]
        a.locate(bolt, upright, floating=True)
        a.contact(f"{name} bolt in plate", moving=bolt.face(tc.select.Cylinder()), reference=on_plate)
        a.contact(f"{name} fit", moving=bore, reference=bolt.face(tc.select.Cylinder()))
    left, right = (part for part in a.parts if part.name in ("left", "right"))
    faces = left.point(ARM, 0, 20), right.point(-ARM, 0, 20)
    a.measure("distance", faces[0], to=faces[1], along="x")

    def centred(poses):
        """The distance, were every hole of a support about the same axis as that of the plate."""
        off = {name: poses.position(bore) - poses.position(hole) for name, (hole, bore) in axes.items()}
        return (poses.position(faces[1]) - off["right"] - (poses.position(faces[0]) - off["left"]))[0]

    a.measure("distance without float", centred)
    return a


def _datums(plate: tc.Part, top: float, far: float) -> None:
    plate.feature("top", plate.face("+z", lambda c, n: abs(c[:, 2] - top) < 1e-6), datum="A")
    plate.feature("side", plate.face("-y", lambda c, n: c[:, 1] < -19), datum="B")
    plate.feature("end", plate.face("-x", lambda c, n: c[:, 0] < -far), datum="C")
