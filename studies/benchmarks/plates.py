"""Plates by Kirchhoff's theory, with NumPy alone: stiffness by differences of the deflection, and its file for a model."""

import tempfile
from pathlib import Path
from typing import TypedDict

import numpy as np

CELLS = 20  # along a side
IN_PLANE = 1e7  # times the stiffness against bending
_FOLDER = tempfile.TemporaryDirectory(prefix="plates-")


class ElasticFiles(TypedDict):
    """The files of `part.elastic`."""

    stiffness: Path
    nodes: Path


def plate_stiffness(side: float, thickness: float, young: float, poisson: float) -> tuple[np.ndarray, np.ndarray]:
    """Return points x, y (node, 2) [mm] of a free square plate, and the stiffness [N/mm] of their deflections.

    The bending energy is D/2 times the integral of (xx + yy)² - 2 (1 - nu) (xx yy - xy²) in second differences.
    It is exact for a twist.
    """
    count, step = CELLS + 1, side / CELLS
    second, first = np.diff(np.eye(count), 2, axis=0) / step**2, np.diff(np.eye(count), axis=0) / step
    inner = np.eye(count)[1:-1]
    xx, yy, xy = np.kron(second, inner), np.kron(inner, second), np.kron(first, first)
    area = side**2 / np.array([len(xx), len(xy)])  # of a value of the differences
    curved = (xx + yy).T @ (xx + yy) - (1 - poisson) * (xx.T @ yy + yy.T @ xx)
    twisted = 2 * (1 - poisson) * xy.T @ xy
    rigidity = young * thickness**3 / 12 / (1 - poisson**2)
    grid = np.stack(np.meshgrid(*(np.linspace(0, side, count),) * 2, indexing="ij"), -1).reshape(-1, 2)
    return grid, rigidity * (area[0] * curved + area[1] * twisted)


def nodes_at(grid: np.ndarray, places: list[tuple[float, float]]) -> list[int]:
    """Return the nodes of a grid at places x, y."""
    return [int(((grid - place) ** 2).sum(axis=1).argmin()) for place in places]


def elastic_file(name: str, places: np.ndarray, stiffness: np.ndarray) -> ElasticFiles:
    """Return the keywords of `part.elastic` for nodes at `places` x, y with z = 0, and the `stiffness` of their heights.

    In their plane they do not deform. The file lives as long as the process.
    """
    arms = places - places.mean(axis=0)
    moves = np.zeros((len(places), 2, 3))
    moves[:, 0, 0] = moves[:, 1, 1] = 1.0
    moves[:, :, 2] = arms @ [[0, 1], [-1, 0]]
    rigid = np.linalg.qr(moves.reshape(-1, 3))[0]
    K = np.zeros((len(places), 3, len(places), 3))
    stiff = IN_PLANE * np.abs(stiffness).max() * (np.eye(len(rigid)) - rigid @ rigid.T)
    K[:, :2, :, :2] = stiff.reshape(len(places), 2, len(places), 2)
    K[:, 2, :, 2] = stiffness
    path = Path(_FOLDER.name) / f"{name}.npz"
    np.savez(path, K=K.reshape(3 * len(places), -1), nodes=np.column_stack([places, np.zeros(len(places))]))
    return {"stiffness": path, "nodes": path}


def saved_body(name: str, nodes: np.ndarray, deformations: np.ndarray, stiffness: np.ndarray) -> ElasticFiles:
    """Return the keywords of `part.elastic` for a body with few `deformations` (deformation, 3 node) and their `stiffness`.

    All others are 1e7 times as stiff as the stiffest of these. The file lives as long as the process.
    """
    arms = nodes - nodes.mean(axis=0)
    motions = [*(np.tile(axis, len(nodes)) for axis in np.eye(3)), *(np.cross(axis, arms).ravel() for axis in np.eye(3))]
    known = np.linalg.qr(np.column_stack([*motions, *deformations]))[0]
    soft = deformations.T @ stiffness @ deformations
    path = Path(_FOLDER.name) / f"{name}.npz"
    np.savez(path, K=soft + IN_PLANE * np.abs(soft).max() * (np.eye(len(soft)) - known @ known.T), nodes=nodes)
    return {"stiffness": path, "nodes": path}
