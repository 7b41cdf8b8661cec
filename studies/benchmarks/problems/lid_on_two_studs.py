"""A lid with two holes on two studs, free to shift and turn."""

import numpy as np
import trimesh
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
CLEARANCE = N.hole - N.stud
SPREAD = np.sqrt(2) * N.s  # of each component of the vector between two axes


def solution():
    # A distance d has (d / SPREAD)² noncentral chi square with 2 degrees of freedom.
    centre = (N.length / SPREAD) ** 2

    def below(d):
        return stats.ncx2.cdf((d / SPREAD) ** 2, 2, centre)

    def fits(d):
        density = stats.ncx2.pdf((d / SPREAD) ** 2, 2, centre) * 2 * d / SPREAD**2
        return density * (below(d + CLEARANCE) - below(d - CLEARANCE))

    return (1 - integrate.quad(fits, N.length - 10 * SPREAD, N.length + 10 * SPREAD, epsabs=1e-11, limit=200)[0],)


def check():
    y, w = np.polynomial.hermite_e.hermegauss(8)
    w = w / w.sum()
    x, step = np.linspace(-9, 9, 801, retstep=True)
    weights = (stats.norm.pdf(x) * step)[:, None, None] * w[:, None] * w
    studs = np.hypot(N.length + SPREAD * x[:, None, None], SPREAD * y[:, None])
    across = SPREAD * y

    def below(d):
        return stats.norm.cdf((np.sqrt(d**2 - across**2) - N.length) / SPREAD)

    return (1 - (weights * (below(studs + CLEARANCE) - below(studs - CLEARANCE))).sum(),)


def plate(model, name, bodies, face, z, outside, **fixed):
    """Declare a plate with two cylinders, or two rings, whose axes vary in x and y."""
    slab = trimesh.creation.box(bounds=[(-20, -15, z), (N.length + 20, 15, z + 2)])
    part = model.part(name, tc.Mesh(trimesh.util.concatenate([slab, *bodies])), **fixed)
    seat = z if outside == "-z" else z + 2
    part.feature("seat", part.face(outside, lambda c, n: abs(c[:, 2] - seat) < 1e-6), datum="A")
    part.feature("side", part.face("-y", lambda c, n: c[:, 1] < -14), datum="B")
    part.feature("end", part.face("-x", lambda c, n: c[:, 0] < -19), datum="C")
    zone = 2 * np.sqrt(-2 * np.log(0.0027)) * N.s  # holds 99.73 % of axes
    return part, [
        part.feature(
            f"{name} {k}",
            part.face(face, tc.select.Inside((x - 9, -9, -9), (x + 9, 9, 9))),
            tc.Position(zone, "A|B|C", rule="translation"),
        )
        for k, x in enumerate((0, N.length))
    ]


def assembly():
    model = tc.Assembly("lid on two studs", method=tc.Method(resolution="exact", objective="seating"))
    rings = [trimesh.creation.annulus(N.hole / 2, 6, 4, sections=32).apply_translation((x, 0, 0)) for x in (0, N.length)]
    studs = [trimesh.creation.cylinder(N.stud / 2, 8, sections=32).apply_translation((x, 0, 0)) for x in (0, N.length)]
    lid, bores = plate(model, "lid", rings, tc.select.Cylinder(radius=N.hole / 2, inner=True), 2, "-z")
    _, pins = plate(model, "base", studs, tc.select.Cylinder(), -6, "+z", fixed=True)
    feet = [tc.Locator(f"Z{k}", (x, y, 2), "z", 0.0) for k, (x, y) in enumerate([(5, 0), (-5, 0), (0, 5)])]
    model.locate(lid, feet, floating=True)
    for k, (bore, pin) in enumerate(zip(bores, pins, strict=True)):
        model.contact(f"fit {k}", moving=bore, reference=pin)
    model.force("push", at=lid.point(0, 0, 2), vector=(3, 1, 0))
    model.measure("x", lid.point(0, 0, 2), along="x")
    return model


def answers():
    results = an.simulated(assembly(), 6000)
    return an.Answers([an.share(an.not_assembled(results))], 6000)
