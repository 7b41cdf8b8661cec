"""The solver on the graph of bodies, beside optimality conditions, CasADi's plugins, and within models."""

from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from tests.helpers import nightly
from tolcontact.compilation.graph import GraphSolver
from tolcontact.compilation.plugins import PLUGINS, solver

MODELS = Path(__file__).resolve().parents[1] / "models"
FREEDOMS, PRICE, OPENING = 6, 50.0, 1e-3


class Problem:
    """A random QP on a graph of bodies: each joint couples two bodies, or one and the ground, and has a slack."""

    def __init__(self, rng, joints, bodies, rows=4, *, equations=0, coupled=False, copies=0, conflict=False):
        self.size, self.slacks = FREEDOMS * bodies, len(joints)
        A, opens = [], []
        for k, joint in enumerate(joints):
            base = rng.normal(size=(rows, FREEDOMS))
            base[:copies] = base[-1]  # dependent rows
            block = np.zeros((rows, self.size))
            for sign, body in zip((1, -1), joint, strict=False):
                block[:, FREEDOMS * body : FREEDOMS * body + FREEDOMS] = sign * base + (0 if copies else 0.3) * rng.normal(
                    size=base.shape
                )
            A += [*block]
            opens += [k] * rows
        A = np.array(A)
        A /= np.linalg.norm(A, axis=1, keepdims=True)
        low = rng.normal(size=len(A)) * 0.5
        if conflict:  # the opposite of some rows, in another joint, with bounds that exclude each other
            some = rng.choice(len(A), 2, replace=False)
            A = np.vstack([A, -A[some]])
            low = np.append(low, 0.1 - low[some])
            opens += [(opens[k] + 1) % self.slacks for k in some]
        columns = np.zeros((len(A), self.slacks))
        columns[np.arange(len(A)), opens] = OPENING
        self.equations = equations
        B = np.zeros((equations, self.size + self.slacks))
        for k in range(equations):
            body = rng.integers(bodies)
            B[k, FREEDOMS * body : FREEDOMS * body + FREEDOMS] = rng.normal(size=FREEDOMS)
        self.A = np.vstack([np.hstack([A, columns]), B])
        self.low = np.append(low, 0.1 * rng.normal(size=equations))
        H = np.eye(self.size)
        if coupled:
            for i, j in (joint for joint in joints if len(joint) == 2):
                cut_i, cut_j = (slice(FREEDOMS * body, FREEDOMS * body + FREEDOMS) for body in (i, j))
                H[cut_i, cut_j] = 0.1 * rng.normal(size=(FREEDOMS, FREEDOMS))
                H[cut_j, cut_i] = H[cut_i, cut_j].T
            lowest = np.linalg.eigvalsh(H)[0]
            H = (H + max(0.05 - lowest, 0) * np.eye(self.size)) / (1 + max(0.05 - lowest, 0))
        self.H = np.block([
            [H, np.zeros((self.size, self.slacks))], [np.zeros((self.slacks, self.size)), np.eye(self.slacks)]
        ])  # fmt: skip
        self.g = np.append(0.3 * rng.normal(size=self.size), np.full(self.slacks, PRICE))

    def sparsities(self):
        h, a = (ca.DM(abs(matrix) > 0).sparsity() for matrix in (self.H, self.A))
        h, a = (ca.sparsify(ca.DM(matrix)).sparsity() for matrix in (self.H, self.A))
        return {"h": h, "a": a, "g": ca.Sparsity.dense(len(self.g), 1), "lba": ca.Sparsity.dense(len(self.low), 1)}

    def stored(self):
        nonzeros = {name: np.array(ca.sparsify(ca.DM(M)).nonzeros())[None] for name, M in (("h", self.H), ("a", self.A))}
        return nonzeros | {"g": self.g[None], "lba": self.low[None]}

    def solved(self, reactions=None):
        rows = len(self.low) - self.equations
        graph = GraphSolver(self.sparsities(), slacks=self.slacks, equations=self.equations)
        answer, failed = graph(self.stored(), np.zeros((1, rows)) if reactions is None else reactions[None])
        assert not failed[0]
        return {name: values[0] for name, values in answer.items()}

    def residual(self, answer):
        """Return the largest violation of the optimality conditions, which are sufficient, since the QP is strictly convex."""
        x, lam_a, lam_x = (answer[name] for name in ("x", "lam_a", "lam_x"))
        excess, rows = self.A @ x - self.low, len(self.low) - self.equations
        conditions = [
            self.H @ x + self.g + self.A.T @ lam_a + lam_x,
            np.minimum(excess[:rows], -lam_a[:rows]),
            excess[rows:],
            np.minimum(x[self.size :], -lam_x[self.size :]),
            lam_x[: self.size],
        ]
        return max(np.abs(values).max(initial=0) for values in conditions)

    def by_plugin(self, name):
        function = solver(PLUGINS[name], ca.Sparsity.dense(*self.H.shape), ca.Sparsity.dense(*self.A.shape))
        lower = np.append(np.full(self.size, -np.inf), np.zeros(self.slacks))
        upper = np.append(np.full(len(self.low) - self.equations, np.inf), self.low[len(self.low) - self.equations :])
        done = function(h=self.H, g=self.g, a=self.A, lba=self.low, uba=upper, lbx=lower, ubx=np.inf)
        return done["x"].full().ravel()


def tower(rng, bodies):
    return [(k, k - 1) if k else (0,) for k in range(bodies)]


def tree(rng, bodies):
    return [(k, int(rng.integers(k))) if k else (0,) for k in range(bodies)]


def star(rng, bodies):
    return [(k, 0) for k in range(1, bodies)] or [(0,)]


def loops(rng, bodies):
    extra = [tuple(rng.choice(bodies, 2, replace=False).tolist()) for _ in range(bodies // 2)] if bodies > 1 else []
    return tower(rng, bodies) + extra


def single(rng, bodies):
    return [(0,)] * bodies


SHAPES = (tower, tree, star, loops, single)
KINDS = ({}, {"equations": 3}, {"coupled": True}, {"copies": 2}, {"conflict": True}, {"coupled": True, "equations": 2})


def random_problem(seed, largest=8):
    rng = np.random.default_rng(seed)
    shape, kind = SHAPES[seed % len(SHAPES)], KINDS[seed // len(SHAPES) % len(KINDS)]
    number = int(rng.integers(1, largest + 1))
    joints = shape(rng, number)
    if "conflict" in kind and len(joints) == 1:
        kind = {}
    return Problem(rng, joints, 1 if shape is single else number, **kind), rng


@pytest.mark.parametrize("start, count", [(0, 200), *nightly((200, 2000))])
def test_random_graphs_fulfil_the_optimality_conditions(start, count):
    residuals = {}
    for seed in range(start, start + count):
        problem, rng = random_problem(seed)
        guess = rng.random(len(problem.low) - problem.equations) * (rng.random() < 0.5)
        residuals[seed] = problem.residual(problem.solved(guess))
    assert max(residuals.values()) < 1e-9, sorted(residuals.items(), key=lambda entry: -entry[1])[:5]
