"""A hole whose position tolerance grows with its size."""

import numpy as np
from scipy import integrate, stats

import tolcontact as tc
from studies.benchmarks import answers as an, parts
from studies.benchmarks.problem import numbers

N = numbers(__file__)
OUTSIDE = 0.0027
PER_ZONE = 1 / (2 * np.sqrt(-2 * np.log(OUTSIDE)))  # standard deviation of a component in a zone of 1


def zone(size):
    """Return the width of the zone for a deviation of the size."""
    return N.t + np.maximum(size + N.half, 0)


def solution():
    size = stats.norm(0, N.half / 3)

    def mean(f):
        spans = ((-4 * N.half, -N.half), (-N.half, 4 * N.half))
        return sum(integrate.quad(lambda d: size.pdf(d) * f(d), *span, epsabs=1e-13)[0] for span in spans)

    beyond = mean(lambda d: np.exp(-((N.t / 2 / (PER_ZONE * zone(d))) ** 2) / 2))
    return PER_ZONE * np.sqrt(mean(lambda d: zone(d) ** 2)), beyond, OUTSIDE


def check():
    nodes, weights = np.polynomial.legendre.leggauss(400)
    # In z = size / sigma, split where the bonus begins.
    z = np.concatenate([(nodes - 1) * 3 - 3, (nodes + 1) * 6 - 3])
    w = np.concatenate([3 * weights, 6 * weights]) * np.exp(-(z**2) / 2) / np.sqrt(2 * np.pi)
    width = N.t + np.where(z > -3, (z + 3) * N.half / 3, 0)
    s = width / 2 / stats.chi2.isf(OUTSIDE, 2) ** 0.5
    shares = [w @ stats.chi2.sf((limit / 2 / s) ** 2, 2) for limit in (N.t, width)]
    return np.sqrt(w @ s**2), *shares


def assembly():
    model = tc.Assembly("hole at maximum material")
    position = tc.Position(N.t, "A|B", material="M", rule="translation")
    bore = parts.ring(model, N.d / 2, 20, "bore", tc.Size(N.d, N.half), position)
    for axis in "xy":
        model.measure(axis, bore.axis(1), along=axis)
    return model


def answers():
    results = an.simulated(assembly(), 200_000, keep="all")
    x, y = (an.values(results, axis) for axis in "xy")
    size = results["sample"].deviation.sel(contributor="ring.bore.size").values
    deviation_width = 2 * np.hypot(x, y)
    return an.Answers([an.deviation(x), an.share(deviation_width > N.t), an.share(deviation_width > zone(size))], len(x))
