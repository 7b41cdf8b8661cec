"""A clamped round plate that a force presses onto a stop."""

import numpy as np
from scipy import stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.plates import saved_body
from studies.benchmarks.problem import numbers

N = numbers(__file__)
RIGIDITY = N.E * N.h**3 / 12 / (1 - N.nu**2)
PLACES = (-N.a, N.b)  # x of the force and of the stop
MODES, SIDE = 128, 2.4 * N.radius


def green():
    """Return the deflections [mm/N] at the force and at the stop, by forces there, after Michell."""
    x, y = np.meshgrid(np.array(PLACES) / N.radius, np.array(PLACES) / N.radius)
    apart, image = (x - y) ** 2, (1 - x * y) ** 2
    logarithm = apart * np.log(np.where(apart > 0, apart, 1) / image)
    return N.radius**2 / 16 / np.pi / RIGIDITY * ((1 - x**2) * (1 - y**2) + logarithm)


def forces(flexibility, gaps):
    """Return the force on the stop for its gaps."""
    return np.maximum(flexibility[0, 1] * N.F - gaps, 0) / flexibility[1, 1]


def solution():
    G = green()
    most = G[0, 1] * N.F - N.gap
    mean = (most * stats.norm.cdf(most / N.s) + N.s * stats.norm.pdf(most / N.s)) / G[1, 1]
    return G[0, 0] * N.F, forces(G, N.gap), mean


def derived(term):
    """Return the derivative of a sum of terms c r^p (ln r)^q, by (p, q)."""
    result: dict[tuple[int, int], float] = {}
    for (p, q), c in term.items():
        result[p - 1, q] = result.get((p - 1, q), 0) + c * p
        if q:
            result[p - 1, q - 1] = result.get((p - 1, q - 1), 0) + c * q
    return result


def mode(n, load, place):
    """Return the deflection at radius `place` by a ring load at `load` of n waves, for radius and rigidity 1, in two zones."""
    inner = [(n, 0), (n + 2, 0)]
    outer = [*inner, *{0: [(0, 1), (2, 1)], 1: [(-1, 0), (1, 1)]}.get(n, [(-n, 0), (2 - n, 0)])]

    def rows(terms, r, orders):
        columns, values = [{term: 1.0} for term in terms], []
        for order in range(4):
            if order in orders:
                values.append([sum(c * r**p * np.log(r) ** q for (p, q), c in column.items()) for column in columns])
            columns = [derived(column) for column in columns]
        return np.array(values)

    matched = np.hstack([-rows(inner, load, range(4)), rows(outer, load, range(4))])
    clamped = np.hstack([np.zeros((2, 2)), rows(outer, 1.0, range(2))])
    A, jump = np.vstack([matched, clamped]), np.array([0, 0, 0, 1 / (np.pi * load * (2 if n == 0 else 1)), 0, 0])
    scale = np.abs(A).max(axis=0)
    c = np.linalg.solve(A / scale, jump) / scale
    terms, factors = (inner, c[:2]) if place <= load else (outer, c[2:])
    return float(rows(terms, place, range(1))[0] @ factors)


def by_modes(load, place, sign):
    """Return a deflection at a place on the same or (sign -1) the other side; the modes left out fall with their cube."""
    terms = np.array([sign**n * mode(n, load, place) for n in range(2 * MODES)])
    rough, fine = terms[:MODES].sum(), terms.sum()
    return fine + (fine - rough) / 3 * (sign > 0)


def check():
    radii = np.abs(PLACES) / N.radius
    G = [[by_modes(load, place, 1 if load == place else -1) for load in radii] for place in radii]
    G = np.array(G) * N.radius**2 / RIGIDITY
    lost, nodes, weights = G[0, 1] * N.F, *np.polynomial.legendre.leggauss(80)
    low = N.gap - 12 * N.s
    gaps = low + (lost - low) * (nodes + 1) / 2
    mean = (lost - low) / 2 * weights @ (forces(G, gaps) * stats.norm.pdf(gaps, N.gap, N.s))
    return G[0, 0] * N.F, forces(G, N.gap), mean


def assembly(gap=N.gap, tolerance=6 * N.s):
    """Return the plate in its frame, which three nodes hold; its deflections are the inverse of Green's function."""
    frame = [(0, 0), (SIDE, 0), (0, SIDE)]
    places = np.array([*frame, *((SIDE / 2 + x, SIDE / 2) for x in PLACES)])
    sunk = np.zeros((2, len(places), 3))
    for k, place in enumerate(places[3:]):
        sunk[k, :3, 2] = -np.linalg.solve(np.vstack([np.ones(3), places[:3].T]), [1, *place])
        sunk[k, 3 + k, 2] = 1
    nodes = np.column_stack([places, np.zeros(len(places))])
    model = tc.Assembly("clamped plate", method=tc.Method(objective="seating"))
    plate = model.part("plate", tc.Box(SIDE, SIDE, N.h))
    plate.elastic(**saved_body("clamped plate", nodes, sunk.reshape(2, -1), np.linalg.inv(green())))
    holds = [tc.Locator(f"A{k}", (*place, 0), "z", 0.0) for k, place in enumerate(frame)]
    stop = tc.Locator("stop", nodes[4], "z", tc.Tolerance(tolerance, shift=-gap), one_sided=True)
    sides = [tc.Locator(f"B{k}", (*frame[k], 0), "y", 0.0) for k in (0, 1)]
    model.locate(plate, [*holds, stop, *sides, tc.Locator("C", (*frame[0], 0), "x", 0.0)])
    model.force("press", at=plate.point(*nodes[3]), vector=(0, 0, -N.F))
    model.measure("under the force", plate.point(*nodes[3]), along="z")
    return model


def answers():
    free = an.values(an.simulated(assembly(gap=10.0, tolerance=0.0), 2), "under the force")[0]
    held, drawn = (
        an.simulated(assembly(tolerance=tolerance), samples).reaction.sel(pair="supports of plate").values
        for tolerance, samples in ((0.0, 2), (6 * N.s, 20_000))
    )
    return an.Answers([an.within(-free, 1e-6 * abs(free)), an.within(held[0], 1e-6 * held[0]), an.mean(drawn)], len(drawn))
