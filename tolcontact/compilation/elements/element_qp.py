"""The contact QP of a group of many bodies, assembled from its elements."""

import itertools
from collections.abc import Sequence

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.compilation.conditioning import SLACK
from tolcontact.compilation.contact_qp import Evaluators, Standing, row_spans
from tolcontact.compilation.contact_rows import standing_points
from tolcontact.compilation.elements.corrected_poses import CorrectedPoses
from tolcontact.compilation.elements.element import elements_of
from tolcontact.compilation.elements.element_batch import Arrays, ElementBatch, Numbers, evaluated, split
from tolcontact.compilation.elements.element_functions import (
    element_functions,
    function_of,
    mover_functions,
)
from tolcontact.compilation.elements.sparse_layout import BlockSum, SparseLayout
from tolcontact.compilation.functions import NamedFunction, flat
from tolcontact.compilation.outcome import step_share
from tolcontact.compilation.plugins import Plugin
from tolcontact.discretization import Nominal
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.gap import GapMap
from tolcontact.mechanics.groups import Group, curved_pairs
from tolcontact.mechanics.objective import points_scale
from tolcontact.mechanics.pose import ENTRIES
from tolcontact.mechanics.setting import face_heights, face_poses
from tolcontact.method import Method

MANY_MOVERS = 6  # from which on a group is assembled from elements
MAX_ENTRIES = 1_000_000  # of the terms of all elements of a batch of realizations
POINT_OBJECTIVES = ("active points", "all points")


def has_elements(group: Group, method: Method) -> bool:
    """Return whether a group has many bodies, and its objective is a sum over its pairs."""
    is_sum = method.objective in POINT_OBJECTIVES and method.regularization == "points"
    return is_sum and len(group.free) >= MANY_MOVERS


class ElementQP:
    """The QP of a group as ContactQP has it, by functions of its elements; it has no equations.

    slacks, equations, standing, plugin, spans   as in ContactQP
    """

    equations = 0

    def __init__(
        self, nominal: Nominal, group: Group, gaps: Sequence[GapMap | None], method: Method, plugin: Plugin, standing: Standing
    ) -> None:
        self.plugin, self._group, self._method = plugin, group, method
        self.standing = standing or [standing_points(nominal.pairs[k], gaps[k], method) for k in group.pairs]
        self.slacks, self.spans = len(group.pairs), row_spans(self.standing)
        self._projects = method.is_iterated or bool(curved_pairs(nominal, group))
        self._batches = _batches(nominal, group, method, self.standing, projects=self._projects)
        self._movers, self._size = mover_functions(), FREEDOMS * len(group.free)
        self._corrected_poses = CorrectedPoses(group, method)
        self._shared = _shared_function(nominal, group)
        self._share = _share_function(self._size)
        self._number_movers()
        self._lay_out()

    @property
    def kinds(self) -> int:
        """The number of kinds of elements, each with functions of its own."""
        return len(self._batches)

    @property
    def max_batch(self) -> int:
        """The number of realizations whose terms fit into little memory."""
        entries = sum(batch.pairs.size * batch.size * (2 * batch.size + ENTRIES) for batch in self._batches)
        return max(16, MAX_ENTRIES // entries)

    @property
    def evaluators(self) -> Evaluators:
        """The functions of the QP."""
        return Evaluators(self.assemble, self.finish, self.energy, self.relate)

    def sparsity(self, name: str) -> ca.Sparsity:
        """Return the sparsity of h, g, a or lba."""
        if name in ("h", "a"):
            return self._layouts[name].sparsity
        return ca.Sparsity.dense(self._size + self.slacks if name == "g" else self.spans[-1].stop, 1)

    def assemble(self, **inputs: Float[Array, "realization _"]) -> Arrays:
        """Return h, g, a, lba and uba, and what `finish` needs beside them, for the inputs of contact_qp."""
        count, length = len(inputs["poses"]), self._group.length
        shared = self._shared_arrays(inputs)
        newton = self._method.is_exact and bool(inputs["newton"].any())
        terms = [batch.terms(inputs, shared, newton=newton) for batch in self._batches]
        Q, Q_between, pull = self._summed(terms, inputs, newton=newton)
        whitened = _of_blocks(self._movers.whiten, Q=Q, pull=pull)
        V, g = whitened["V"], whitened["g"]
        between = self._coupled
        H = _of_blocks(self._movers.couple, Q=Q_between, V_i=V[:, between[:, 0]], V_j=V[:, between[:, 1]])["H"]
        rows = [batch.conditioned(local, V, length) for batch, local in zip(self._batches, terms, strict=True)]
        h = np.ones((count, len(self._layouts["h"])))
        h[:, self._coupling_places] = flat(np.concatenate([H, H], axis=1))
        a = np.empty((count, len(self._layouts["a"])))
        by_row = {name: np.empty((count, self.spans[-1].stop)) for name in ("lba", "row_length", "filled")}
        for batch, places, opening_places, local, row in zip(self._batches, *self._row_places, terms, rows, strict=True):
            a[:, places], a[:, opening_places] = row["a"], row["opening"]
            by_row["lba"][:, batch.rows], by_row["row_length"][:, batch.rows] = row["lower"], row["row_length"]
            by_row["filled"][:, batch.rows] = local["filled"]
        prices = np.full((count, self.slacks), length)
        return {
            "h": h, "g": np.concatenate([flat(g), prices], axis=1), "a": a,
            "uba": np.full(by_row["lba"].shape, np.inf), "V": flat(V),
            "faces": shared["faces"], "scale": shared["scale"],
            **by_row,
        }  # fmt: skip

    def finish(self, **arrays: Float[Array, "realization _"]) -> Arrays:
        """Return the outputs of contact_qp."""
        count, x, lam_x = len(arrays["x"]), arrays["x"], arrays["lam_x"]
        y, slack = split(x[:, : self._size], FREEDOMS), x[:, self._size :]
        step = _of_blocks(self._movers.step, V=split(arrays["V"], FREEDOMS**2), y=y)["step"]
        stride = arrays["stride"] if self._method.is_exact else np.full((count, 1), np.inf)
        length = np.full((count, 1), self._group.length)
        share = self._share(step=flat(step), y=flat(y), stride=stride, length=length)
        checked = [self._checked(*entry, arrays, y, slack) for entry in zip(self._batches, *self._row_places, strict=True)]
        between, H = (
            self._coupled,
            split(arrays["h"][:, self._coupling_places[: FREEDOMS**2 * len(self._coupled)]], FREEDOMS**2),
        )
        pulls = _of_blocks(self._movers.pull, H=H, y_i=y[:, between[:, 0]], y_j=y[:, between[:, 1]])
        forces = [split(local["force"], FREEDOMS) for local in checked]
        force = flat(self._force_sum(np.concatenate([*forces, pulls["force_i"], pulls["force_j"]], axis=1)))
        slack_force, multipliers = np.empty((count, self.slacks)), np.empty((count, self.spans[-1].stop))
        for batch, local in zip(self._batches, checked, strict=True):
            slack_force[:, batch.pairs], multipliers[:, batch.rows] = local["slack_force"][:, :, 0], local["multipliers"]
        stationarity = x + arrays["g"] + np.concatenate([force, slack_force], axis=1) + lam_x
        residuals = [
            np.abs(stationarity), np.abs(np.minimum(slack, -lam_x[:, self._size :])),
            *(local["residual"][:, :, 0] for local in checked),
        ]  # fmt: skip
        poses, faces = (split(arrays[name], ENTRIES) for name in ("poses", "faces"))
        corrected = self._corrected_poses(poses, step * share["share"][:, :, None])
        linearized, relative = (np.empty((count, self.slacks, ENTRIES)) for _ in range(2))
        for batch in self._batches:
            linearized[:, batch.pairs] = batch.linearized(poses, faces, step, self._group.length)
            relative[:, batch.pairs] = batch.relative(corrected, faces)
        return {
            "corrected": flat(corrected),
            "linearized": flat(linearized),
            "relative": flat(relative),
            "multipliers": multipliers,
            "residual": np.concatenate(residuals, axis=1).max(axis=1, keepdims=True),
            "slack": SLACK * slack,
            "step": share["size"],
            "astray": np.zeros((count, 1)),
        }

    def energy(self, **inputs: Float[Array, "realization _"]) -> Arrays:
        """Return the objective of contact_qp."""
        inputs = {name: flat(values) for name, values in inputs.items()}
        shared = self._shared_arrays(inputs)
        energies = [batch.energy(inputs, shared)[..., 0] for batch in self._batches]
        return {"energy": np.concatenate(energies, axis=1).sum(axis=1, keepdims=True)}

    def relate(self, **inputs: Float[Array, "realization _"]) -> Arrays:
        """Return X_RM of all pairs at `poses`."""
        count = len(inputs["poses"])
        poses = split(inputs["poses"], ENTRIES)
        faces = self._shared(deviations=inputs["deviations"], moments=np.zeros((count, MOMENTS * len(self._group.sides))))[
            "faces"
        ]
        relative = np.empty((count, self.slacks, ENTRIES))
        for batch in self._batches:
            relative[:, batch.pairs] = batch.relative(poses, split(faces, ENTRIES))
        return {"relative": flat(relative)}

    def _shared_arrays(self, inputs: Arrays) -> Arrays:
        """Return the inputs of elements that are computed once for all of them."""
        shared = self._shared(**{name: inputs[name] for name in ("deviations", "moments")})
        shared |= {"length": np.full((1, 1), self._group.length), "count": np.full((1, 1), self._group.count)}
        if "firmness" in inputs:
            shared |= {"firmness": inputs["firmness"], "load": inputs["reactions"].sum(axis=1, keepdims=True)}
        return shared

    def _summed(self, terms: Sequence[Arrays], inputs: Arrays, *, newton: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the blocks of Q (n, mover, 36), those between two movers (n, coupling, 36), and the pull (n, mover, 6)."""
        (Q, between), pull = self._blocks("Q", terms), self._vectors("pull", terms)
        if newton:
            curvature, curvature_between = self._blocks("curvature", terms)
            convex = _of_blocks(self._movers.factor, Q=Q, curvature=curvature)["convex"][..., 0] > 0
            counts = ((inputs["newton"][:, 0] != 0) & convex.all(axis=1))[:, None, None]
            Q, between = Q + np.where(counts, curvature, 0), between + np.where(counts, curvature_between, 0)
            pull = pull + np.where(counts, self._vectors("hold", terms), 0)
        if self._projects:
            caution = inputs["caution"][:, :, None]
            Q, between = (
                block + caution * near for block, near in zip((Q, between), self._blocks("nearness", terms), strict=True)
            )
        return Q, between, pull

    def _blocks(self, name: str, terms: Sequence[Arrays]) -> tuple[np.ndarray, np.ndarray]:
        """Return the sums of the blocks (n, block, 36) of elements, by mover and by pair of coupled movers."""
        diagonal, between = (
            np.concatenate([split(local[key], FREEDOMS**2) for local in terms], axis=1) for key in (name, f"{name}_between")
        )
        return self._mover_sum(diagonal), self._coupling_sum(between)

    def _vectors(self, name: str, terms: Sequence[Arrays]) -> np.ndarray:
        """Return the sums (n, mover, 6) of vectors (n, element, z) of elements."""
        return self._mover_sum(np.concatenate([split(local[name], FREEDOMS) for local in terms], axis=1))

    def _checked(
        self, batch: ElementBatch, places: np.ndarray, openings: np.ndarray, arrays: Arrays, y: np.ndarray, slack: np.ndarray
    ) -> Arrays:
        """Return what is left of the optimality conditions of the rows of some elements, see ElementFunctions."""
        local = {"a": arrays["a"][:, places], "opening": arrays["a"][:, openings], "y": y[:, batch.movers]}
        local |= {name: arrays[key][:, batch.rows] for name, key in (("lower", "lba"), ("lam", "lam_a"))}
        local |= {name: arrays[name][:, batch.rows] for name in ("row_length", "filled")}
        return batch.checked(local | {"slack": slack[:, batch.pairs, None], "scale": arrays["scale"][:, :, None]})

    def _number_movers(self) -> None:
        """Find out which movers are coupled, and where contributions of elements to movers are summed."""
        count = self._size // FREEDOMS
        diagonal = [batch.movers.ravel() for batch in self._batches]
        pairs = [
            batch.movers[:, [*itertools.combinations(range(batch.movers.shape[1]), 2)]].reshape(-1, 2)
            for batch in self._batches
            if batch.movers.shape[1] > 1
        ]
        between = np.concatenate([np.zeros((0, 2), dtype=int), *pairs])
        codes, numbers = np.unique(between[:, 0] * count + between[:, 1], return_inverse=True)
        self._coupled = np.column_stack(np.divmod(codes, count))
        self._mover_sum = BlockSum(np.concatenate(diagonal), count)
        self._coupling_sum = BlockSum(numbers, len(codes))
        self._force_sum = BlockSum(np.concatenate([*diagonal, *self._coupled.T]), count)

    def _lay_out(self) -> None:
        """Find out where the entries of elements stand in the matrices."""
        freedoms, slacks = np.arange(FREEDOMS), np.arange(self._size, self._size + self.slacks)
        i, j = (FREEDOMS * self._coupled.T)[:, :, None, None]
        row, column = (block.ravel() for block in np.broadcast_arrays(i + freedoms, j + freedoms[:, None]))
        ones = np.arange(self._size + self.slacks)
        shape = (self._size + self.slacks, self._size + self.slacks)
        h = SparseLayout(shape, np.concatenate([row, column, ones]), np.concatenate([column, row, ones]))
        self._coupling_places = h.places[: 2 * row.size]
        rows, columns = [], []
        for batch in self._batches:
            z = (FREEDOMS * batch.movers[:, :, None] + freedoms).reshape(len(batch.pairs), -1)
            blocks = np.broadcast_arrays(batch.rows[:, None, :], z[:, :, None])
            rows += [blocks[0].ravel(), batch.rows.ravel()]
            columns += [blocks[1].ravel(), np.repeat(slacks[batch.pairs], batch.row_count)]
        a = SparseLayout((self.spans[-1].stop, shape[1]), np.concatenate(rows), np.concatenate(columns))
        places = np.split(a.places, np.cumsum([part.size for part in rows])[:-1])
        entries = [places[2 * k].reshape(len(batch.pairs), -1) for k, batch in enumerate(self._batches)]
        openings = [places[2 * k + 1].reshape(batch.rows.shape) for k, batch in enumerate(self._batches)]
        self._row_places = entries, openings
        self._layouts = {"h": h, "a": a}


def _batches(nominal: Nominal, group: Group, method: Method, standing: Standing, *, projects: bool) -> list[ElementBatch]:
    """Return the elements by their kinds."""
    elements = elements_of(nominal, group, standing)
    kinds: dict[object, list] = {}
    for element in elements:
        kinds.setdefault(element.kind, []).append(element)
    numbers = Numbers.of(elements)
    return [
        ElementBatch(members, element_functions(members[0], method, projects=projects), numbers) for members in kinds.values()
    ]


def _shared_function(nominal: Nominal, group: Group) -> NamedFunction:
    """Return the function (deviations, moments) -> faces, heights, scale of what elements take as inputs."""
    inputs = {
        "deviations": ca.SX.sym("deviations", len(nominal.contributors)),
        "moments": ca.SX.sym("moments", MOMENTS, len(group.sides)),
    }
    pairs = [nominal.pairs[index] for index in group.pairs]
    poses = [pose.vector() for pair in pairs for pose in face_poses(pair, inputs["deviations"]) if pose is not None]
    heights = [face_heights(pair, inputs["deviations"]) for pair in pairs]
    outputs = {
        "faces": ca.vertcat(ca.SX(0, 1), *poses),
        "heights": ca.vertcat(*heights),
        "scale": points_scale(inputs["moments"]),
    }
    return function_of("shared", inputs, outputs)


def _share_function(size: int) -> NamedFunction:
    """Return the function (step, y, stride) -> share of the step that is taken, and its size."""
    inputs = {
        "step": ca.SX.sym("step", size),
        "y": ca.SX.sym("y", size),
        "stride": ca.SX.sym("stride"),
        "length": ca.SX.sym("length"),
    }
    share = step_share(inputs["step"], inputs["stride"], inputs["length"])
    step_size = ca.vertcat(ca.norm_inf(inputs["step"]), ca.norm_inf(inputs["y"]))
    return function_of("share", inputs, {"share": share, "size": step_size})


def _of_blocks(function: NamedFunction, **arrays: np.ndarray) -> Arrays:
    """Evaluate a function for all entries of arrays (n, entry, ...)."""
    return evaluated(function, arrays, np.broadcast_shapes(*(values.shape[:2] for values in arrays.values())))
