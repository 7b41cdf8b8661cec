"""A lid with four clearance holes on a base with four studs, position at maximum material: does every pair go together?

Holes and studs are toleranced as drawings do it: their places to three planes of their part, at maximum material condition, so
that a larger hole may be farther off. Expected: parts at their worst just fit (virtual condition: hole 8.2 - 0.15 and stud 7.9
+ 0.15), so nearly all of 1000 assemblies fit; the lid, set down by hand up to half a millimetre off, moves to where it fits.
Dimensions were chosen for this model.

z up. Lengths in mm. A tolerance is the full width of its zone; sizes have limits.
"""

import itertools

import trimesh

import tolcontact as tc

SIZE, HALF = 120.0, 45.0  # of both plates; from their middle to the holes
HOLE, STUD = 8.3, 7.8  # diameters
PLACES = list(itertools.product((-HALF, HALF), repeat=2))
PLACED = 0.8  # tolerance of the place where the lid is set down


def plate(low: float, high: float, bodies: list[trimesh.Trimesh]) -> tc.Mesh:
    slab = trimesh.creation.box(bounds=[(-SIZE / 2, -SIZE / 2, low), (SIZE / 2, SIZE / 2, high)])
    return tc.Mesh(trimesh.util.concatenate([slab, *bodies]))


def at_places(shape: trimesh.Trimesh) -> list[trimesh.Trimesh]:
    return [shape.copy().apply_translation((x, y, 0)) for x, y in PLACES]


def toleranced(part: tc.Part, seat: str, level: float, radius: float, size: tc.Size) -> list[tc.declaration.Feature]:
    """Datums: the seat, the side and the end of the plate. To these the four cylinders."""
    part.feature("seat", part.face(seat, lambda c, n: abs(c[:, 2] - level) < 1e-6), datum="A")
    part.feature("side", part.face("-y", lambda c, n: c[:, 1] < -SIZE / 2 + 1e-6), datum="B")
    part.feature("end", part.face("-x", lambda c, n: c[:, 0] < -SIZE / 2 + 1e-6), datum="C")
    return [
        part.feature(
            f"{part.name} {number + 1}",
            part.face(tc.select.Cylinder(radius=radius), tc.select.Inside((x - 9, y - 9, -9), (x + 9, y + 9, 9))),
            size,
            tc.Position(0.15, "A|B|C", material="M"),
        )
        for number, (x, y) in enumerate(PLACES)
    ]


def assembly() -> tc.Assembly:
    model = tc.Assembly("lid", method=tc.Method(resolution="exact", objective="all points"))
    studs = at_places(trimesh.creation.cylinder(STUD / 2, 8, sections=48))
    rings = at_places(trimesh.creation.annulus(HOLE / 2, 7, 4, sections=48))
    base = model.part("base", plate(-8, -4, studs), fixed=True)
    lid = model.part("lid", plate(2, 4, rings))
    studs_of_base = toleranced(base, "+z", -4.0, STUD / 2, tc.Size(STUD, 0.1))
    holes = toleranced(lid, "-z", 2.0, HOLE / 2, tc.Size(HOLE, 0.1))
    feet = [(-HALF, -HALF), (HALF, -HALF), (0, HALF)]
    model.locate(
        lid,
        [
            *(tc.Locator(f"A{k + 1}", (*foot, 2), "z", 0.0) for k, foot in enumerate(feet)),
            tc.Locator("B1", (-HALF, 0, 2), "y"),
            tc.Locator("B2", (HALF, 0, 2), "y"),
            tc.Locator("C1", (0, 0, 2), "x"),
        ],
        tolerance=PLACED,
    )
    for number, (hole, stud) in enumerate(zip(holes, studs_of_base, strict=True)):
        model.contact(f"hole {number + 1}", moving=hole, reference=stud)
    for axis in "xy":
        model.measure(f"lid off base, {axis}", lid.point(0, 0, 4), along=axis, tolerance=0.5)
    return model


if __name__ == "__main__":
    tc.main(assembly)  # the same as: tolcontact run models/lid.py
