"""The corner force of a twisted plate."""

import numpy as np

from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (2 * N.E * N.h**3 / 12 / (1 + N.nu) / (1 - N.nu) * (1 - N.nu) * N.d / N.side**2,)


def check():
    x, step = np.linspace(0, N.side, 41, retstep=True)

    def energy(lift):
        w = lift * np.outer(x, x) / N.side**2
        xx, yy = np.diff(w, 2, axis=0)[:, 1:-1] / step**2, np.diff(w, 2, axis=1)[1:-1] / step**2
        xy = np.diff(np.diff(w, axis=0), axis=1) / step**2
        stiffness = N.E * N.h**3 / 12 / (1 - N.nu**2)
        curved = (xx**2 + yy**2 + 2 * N.nu * xx * yy).mean()
        return stiffness / 2 * N.side**2 * (curved + 2 * (1 - N.nu) * (xy**2).mean())

    delta = 1e-3
    return ((energy(N.d + delta) - energy(N.d - delta)) / (2 * delta),)
