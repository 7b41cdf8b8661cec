"""Floating and fixed fasteners, with and without a projected tolerance zone."""

import trimesh
from scipy import optimize

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return N.f + N.t, N.f + 2 * N.t, N.f + N.t + N.t * (1 + 2 * N.p / N.d)


def check():
    half = N.t / 2

    def reach(low, high, at):
        # How far an axis may be off at a height, if its ends at the heights `low` and `high` are in the zone.
        share = (at - low) / (high - low)
        return -optimize.linprog([share - 1, -share], bounds=[(-half, half)] * 2).fun

    # The least clearance at which a screw at y is in both holes, which are off by half their zones in opposite directions.
    rows = [[-0.5, 1], [-0.5, -1], [-0.5, 1], [-0.5, -1]]
    clearance = optimize.linprog([1, 0], rows, [half, -half, -half, half], bounds=[(0, None), (None, None)]).fun
    fixed = (max(reach(low, high, at) for at in (0.0, N.p)) for low, high in ((0.0, N.p), (-N.d, 0.0)))
    return N.f + clearance, *(N.f + 2 * (half + reached) for reached in fixed)


def hole(model, name, x, z, height, position):
    """Return a toleranced hole in a ring about (x, 0); its primary datum is the lower face at z."""
    shape = trimesh.creation.annulus(N.f / 2, 2 * N.f, height, sections=48)
    part = model.part(name, tc.Mesh(shape), at=(x, 0, z + height / 2), fixed=True)
    part.feature("face", part.face("-z"), datum="A")
    part.feature("rim", part.face(tc.select.Cylinder(inner=False)), datum="B")
    return part.feature("hole", part.face(tc.select.Cylinder(inner=True)), position)


def assembly():
    model = tc.Assembly("smallest holes")
    shifted = tc.Position(N.t, "A|B", rule="translation")
    threads = {"floating": shifted, "projected": tc.Position(N.t, "A|B", projected=N.p), "tilted": tc.Position(N.t, "A|B")}
    for k, (name, position) in enumerate(threads.items()):
        thread = hole(model, f"{name} thread", 100.0 * k, 0.0, N.d, position)
        # The screw is measured where it leaves the clearance hole, in the middle of a thin ring.
        clearance = hole(model, f"{name} clearance", 100.0 * k, -N.p - 1, 2.0, shifted)
        model.measure(name, tc.AxisDistance(clearance, thread, along=(0.0, 1.0, 0.0)))
    return model


def answers():
    figures = tc.analyses.stack_up(assembly(), samples=3000, solver="daqp").sel(approach="worst case")
    offsets = dict(zip(figures.measure.values.tolist(), figures.half_width.values.tolist(), strict=True))
    holes = N.f + offsets["floating"], N.f + 2 * offsets["projected"], N.f + 2 * offsets["tilted"]
    return an.Answers([an.within(size, 1e-5) for size in holes], 3000)
