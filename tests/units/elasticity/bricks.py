"""Stiffness matrices that are assembled by hand: a block of trilinear hexahedra, and a chain of beams."""

import itertools

import numpy as np


def bricks(size, cells, young=70e3, poisson=0.3):
    """Return nodes (node, 3) [mm] and the stiffness (3 node, 3 node) [N/mm] of a block from the origin to `size`."""
    counts = [cell + 1 for cell in cells]
    axes = [np.linspace(0, length, count) for length, count in zip(size, counts, strict=True)]
    nodes = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    indices, edge = np.arange(len(nodes)).reshape(counts), np.array(size) / cells
    lame, shear = young * poisson / (1 + poisson) / (1 - 2 * poisson), young / 2 / (1 + poisson)
    law = np.diag([2 * shear] * 3 + [shear] * 3)
    law[:3, :3] += lame
    corners = np.array(list(itertools.product((0, 1), repeat=3)))
    signs, element = 2 * corners - 1, np.zeros((24, 24))
    for point in itertools.product((-(3**-0.5), 3**-0.5), repeat=3):
        factors = 1 + signs * point
        slopes = [signs[:, a] * factors[:, (a + 1) % 3] * factors[:, (a + 2) % 3] / 4 / edge[a] for a in range(3)]
        strain = np.zeros((6, 24))
        for a in range(3):
            strain[a, a::3] = slopes[a]
        for row, (a, b) in enumerate(((1, 2), (0, 2), (0, 1)), start=3):
            strain[row, a::3], strain[row, b::3] = slopes[b], slopes[a]
        element += strain.T @ law @ strain * edge.prod() / 8
    stiffness = np.zeros((3 * len(nodes),) * 2)
    for offset in itertools.product(*map(range, cells)):
        freedoms = (3 * indices[tuple((corners + offset).T)][:, None] + np.arange(3)).ravel()
        stiffness[np.ix_(freedoms, freedoms)] += element
    return nodes, stiffness


def bernoulli_frame(nodes, young=210e3, side=10.0):
    """Return the stiffness (6 node, 6 node) of a chain of Euler-Bernoulli beams of a square section through nodes (node, 3)."""
    area, inertia, shear = side**2, side**4 / 12, young / 2.6
    stiffness = np.zeros((6 * len(nodes),) * 2)
    for k, step in enumerate(np.diff(nodes, axis=0)):
        length = np.linalg.norm(step)
        local = np.zeros((12, 12))
        local[np.ix_((0, 6), (0, 6))] = young * area / length * np.array([[1, -1], [-1, 1]])
        local[np.ix_((3, 9), (3, 9))] = shear * 2 * inertia / length * np.array([[1, -1], [-1, 1]])
        bending = np.array([[12, 6, -12, 6], [6, 4, -6, 2], [-12, -6, 12, -6], [6, 2, -6, 4]])
        for freedoms, sense in (((1, 5, 7, 11), 1), ((2, 4, 8, 10), -1)):
            scale = np.array([1, sense * length, 1, sense * length])
            local[np.ix_(freedoms, freedoms)] += young * inertia / length**3 * bending * np.outer(scale, scale)
        x = step / length
        y = np.cross(np.eye(3)[np.argmin(np.abs(x))], x)
        y /= np.linalg.norm(y)
        turned = np.kron(np.eye(4), np.stack([x, y, np.cross(x, y)]))
        span = slice(6 * k, 6 * k + 12)
        stiffness[span, span] += turned.T @ local @ turned
    return stiffness
