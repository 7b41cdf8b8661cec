"""A rigid table on four legs with stiffness."""

import numpy as np
from scipy import integrate, optimize, stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import numbers

N = numbers(__file__)
SINK = N.F / (4 * N.k)


def solution():
    s = N.s / 2
    z = SINK / s
    mean = -SINK + 2 * s * (stats.norm.pdf(z) - z * stats.norm.sf(z))
    beyond = 2 * s**2 * ((1 + z**2) * stats.norm.sf(z) - z * stats.norm.pdf(z))  # second moment of max(0, |w| - f)
    return mean, s**2 + beyond - (mean + SINK) ** 2, 2 * stats.norm.cdf(z) - 1


def check():
    corners = np.array([[1, -1, -1], [1, 1, -1], [1, 1, 1], [1, -1, 1]])  # heights of the corners: middle and two tilts

    def middle(twist):
        legs = twist * np.array([1, -1, 1, -1])

        def forces(pose):
            return corners.T @ (N.k * np.maximum(0, legs - corners @ pose)) - [N.F, 0, 0]

        # Half of a twist is taken by either diagonal; the start has all four legs, or two of them, in contact.
        start = np.array([max(-SINK, abs(twist) - 2 * SINK), 1e-9, -1e-9])
        return optimize.root(forces, start, tol=1e-13).x[0]

    def moment(k):
        spans = ((-6 * N.s, -SINK), (-SINK, SINK), (SINK, 6 * N.s))
        nodes, weights = np.polynomial.legendre.leggauss(24)
        total = 0.0
        for low, high in spans:
            w = (high - low) / 2 * nodes + (high + low) / 2
            total += (high - low) / 2 * weights @ [stats.norm.pdf(x, 0, N.s / 2) * middle(x) ** k for x in w]
        return total

    mean = moment(1)
    carry = integrate.quad(lambda w: stats.norm.pdf(w, 0, N.s / 2), -SINK, SINK, epsabs=1e-14)[0]
    return mean, (N.s / 2) ** 2 + moment(2) - mean**2, carry


def assembly():
    model = tc.Assembly("springy table", method=tc.Method(resolution="exact", objective="seating"))
    top = model.part("table", tc.Box(400, 400, 20))
    corners = ((0, 0, 0), (400, 0, 0), (400, 400, 0), (0, 400, 0))
    legs = [
        tc.Locator(f"leg {k}", corner, "z", 6 * N.s, one_sided=True, stiffness=float(N.k)) for k, corner in enumerate(corners)
    ]
    guides = [
        tc.Locator("B1", (100, 0, 0), "y", 0.0),
        tc.Locator("B2", (300, 0, 0), "y", 0.0),
        tc.Locator("C", (0, 200, 0), "x", 0.0),
    ]
    model.locate(top, [*legs, *guides])
    model.force("load", at=top.point(200, 200, 0), vector=(0, 0, -N.F))
    model.measure("middle", top.point(200, 200, 0), along="z")
    return model


def answers():
    results = an.simulated(assembly(), 20_000)
    middle = an.values(results, "middle")
    all_carry = results.carrying.values[:, 0] == 4
    return an.Answers([an.mean(middle), an.variance(middle), an.share(all_carry)], len(middle))
