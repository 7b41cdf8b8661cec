"""The contact QP of a group of many bodies, assembled from its elements."""

from collections.abc import Sequence

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.compilation.conditioning import SLACK
from tolcontact.compilation.contact_qp import Evaluators, Standing, row_spans
from tolcontact.compilation.contact_rows import standing_points
from tolcontact.compilation.elements.corrected_poses import CorrectedPoses
from tolcontact.compilation.elements.element import elements_of
from tolcontact.compilation.elements.element_batch import Arrays, ElementBatch, Elements, Numbers
from tolcontact.compilation.elements.element_functions import element_functions, function_of
from tolcontact.compilation.elements.element_layout import ElementLayout
from tolcontact.compilation.functions import NamedFunction, flat, located
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


def has_elements(group: Group, method: Method) -> bool:
    """Return whether a group has many bodies, and its objective is a sum over its pairs."""
    is_sum = method.minimizes.counts_points and method.regularization == "points"
    return is_sum and len(group.free) >= MANY_MOVERS


class ElementQP:
    """The QP of a group as ContactQP has it, by functions of its elements; it has no equations and no springs.

    slacks, equations, standing, plugin, spans   as in ContactQP
    """

    equations, has_springs = 0, False

    def __init__(
        self, nominal: Nominal, group: Group, gaps: Sequence[GapMap | None], method: Method, plugin: Plugin, standing: Standing
    ) -> None:
        self.plugin, self._method = plugin, method
        self.standing = standing or [standing_points(nominal.pairs[k], gaps[k], method) for k in group.pairs]
        self.slacks, self.spans = len(group.pairs), row_spans(self.standing)
        self._projects = method.is_iterated or bool(curved_pairs(nominal, group))
        self._size = FREEDOMS * len(group.free)
        kinds = _kinds(nominal, group, method, self.standing, projects=self._projects)
        self._layout = ElementLayout(kinds, movers=len(group.free), rows=self.spans[-1].stop)
        self._batches = [ElementBatch.of(elements, places) for elements, places in zip(kinds, self._layout.places, strict=True)]
        self._movers = self._layout.of_movers()
        self._corrected_poses = CorrectedPoses(group, method)
        self._shared = _shared_function(nominal, group)
        self._share = _share_function(self._size)
        self._values = {
            name: np.full((1, 1), float(value)) for name, value in (("length", group.length), ("count", group.count))
        }
        self._no_moments = np.zeros((1, MOMENTS * len(group.sides)))

    @property
    def kinds(self) -> int:
        """The number of kinds of elements, each with functions of its own."""
        return len(self._batches)

    @property
    def max_batch(self) -> int:
        """The number of realizations whose terms fit into little memory."""
        kinds = [batch.elements for batch in self._batches]
        entries = sum(kind.pairs.size * kind.size * (2 * kind.size + ENTRIES) for kind in kinds)
        return max(16, MAX_ENTRIES // entries)

    @property
    def evaluators(self) -> Evaluators:
        """The functions of the QP."""
        return Evaluators(self.assemble, self.finish, self.energy, self.relate)

    def sparsity(self, name: str) -> ca.Sparsity:
        """Return the sparsity of h, g, a or lba."""
        if name in ("h", "a"):
            return self._layout.matrices[name].sparsity
        return ca.Sparsity.dense(self._size + self.slacks if name == "g" else self.spans[-1].stop, 1)

    def assemble(self, **inputs: Float[Array, "realization _"]) -> Arrays:
        """Return h, g, a, lba and uba, and what `finish` needs beside them, for the inputs of contact_qp."""
        count, layout, rows = len(inputs["poses"]), self._layout, self.spans[-1].stop
        newton = self._method.is_exact and bool(inputs["newton"].any())
        filled = np.ones((count, rows))
        filled[:, layout.slot_rows] = inputs["filled"]
        arrays = inputs | self._shared_arrays(inputs) | {"filled": filled, "gaps": np.empty((count, rows))}
        terms = {name: np.empty((count, size)) for name, size in layout.sizes_of_terms.items()}
        shared = located(arrays | terms)
        local = [shared | batch.arrays(inputs["deviations"]) for batch in self._batches]
        for batch, own in zip(self._batches, local, strict=True):
            function = batch.newton if newton and batch.newton is not None else batch.terms
            function(count, own)
        Q, between, pull = self._summed(terms, inputs, newton=newton)
        V, h, a = (np.ones((count, size)) for size in (Q.shape[1], len(layout.matrices["h"]), len(layout.matrices["a"])))
        g = np.full((count, self._size + self.slacks), self._values["length"][0, 0])  # the prices of slacks
        self._movers.whiten(count, located({"Q": Q, "pull": pull, "V": V, "g": g}))
        self._movers.couple(count, located({"Q": between, "V_i": V, "V_j": V, "H": h, "mirrored": h}))
        by_row = {name: np.empty((count, rows)) for name in ("lower", "row_length")}
        of_rows = located(by_row | {"V": V, "a": a, "opening": a})
        for batch, own in zip(self._batches, local, strict=True):
            batch.rows(count, own | of_rows)
        return {
            "h": h, "g": g, "a": a, "lba": by_row["lower"], "uba": np.full((count, rows), np.inf), "V": V, "filled": filled,
            "faces": arrays["faces"], "scale": arrays["scale"], "row_length": by_row["row_length"],
        }  # fmt: skip

    def finish(self, **arrays: Float[Array, "realization _"]) -> Arrays:
        """Return the outputs of contact_qp."""
        count, x, lam_x, layout = len(arrays["x"]), arrays["x"], arrays["lam_x"], self._layout
        slack, steps = x[:, self._size :], np.empty((count, self._size))
        self._movers.step(count, located({"V": arrays["V"], "y": x, "step": steps}))
        stride = arrays["stride"] if self._method.is_exact else np.full((count, 1), np.inf)
        length = np.repeat(self._values["length"], count, axis=0)
        share = self._share(step=steps, y=x[:, : self._size], stride=stride, length=length)
        corrected = self._corrected_poses(arrays["poses"], steps * share["share"])
        sizes = {
            "residual": self.slacks, "slack_force": self.slacks, "multipliers": self.spans[-1].stop,
            "linearized": ENTRIES * self.slacks, "relative": ENTRIES * self.slacks,
        }  # fmt: skip
        results = {name: np.empty((count, size)) for name, size in sizes.items()}
        forces = np.empty((count, FREEDOMS * len(layout.force_sum.places)))
        checked = results | {"opening": arrays["a"], "y": x, "slack": x, "lam": arrays["lam_a"], "lower": arrays["lba"]}
        checked |= {name: arrays[name] for name in ("a", "row_length", "filled", "scale", "faces")} | {"force": forces}
        before = located(checked | self._values | {"poses": arrays["poses"], "step": steps})
        after = before | located({"poses": corrected})
        for batch in self._batches:
            batch.check(count, before | batch.own)
            batch.advance(count, before | batch.own)
            batch.relate(count, after | batch.own)
        pulls = {"H": arrays["h"], "y_i": x, "y_j": x, "force_i": forces, "force_j": forces}
        self._movers.pull(count, located(pulls))
        force = np.concatenate([layout.force_sum(forces), results["slack_force"]], axis=1)
        stationarity = np.abs(x + arrays["g"] + force + lam_x)
        residuals = [stationarity, np.abs(np.minimum(slack, -lam_x[:, self._size :])), results["residual"]]
        return {
            "corrected": corrected,
            "linearized": results["linearized"],
            "relative": results["relative"],
            "multipliers": results["multipliers"],
            "residual": np.concatenate(residuals, axis=1).max(axis=1, keepdims=True),
            "slack": SLACK * slack,
            "step": share["size"],
            "astray": np.zeros((count, 1)),
        }

    def energy(self, **inputs: Float[Array, "realization ..."]) -> Arrays:
        """Return the objective of contact_qp."""
        inputs = {name: flat(values) for name, values in inputs.items()}
        arrays = inputs | self._shared_arrays(inputs) | {"energy": np.empty((len(inputs["poses"]), self.slacks))}
        shared = located(arrays)
        for batch in self._batches:
            batch.energy(len(inputs["poses"]), shared | batch.own)
        return {"energy": arrays["energy"].sum(axis=1, keepdims=True)}

    def relate(self, **inputs: Float[Array, "realization ..."]) -> Arrays:
        """Return X_RM of all pairs at `poses`."""
        poses, deviations = flat(inputs["poses"]), flat(inputs["deviations"])
        count = len(poses)
        moments = np.repeat(self._no_moments, count, axis=0)
        arrays = {"poses": poses, "faces": self._shared(deviations=deviations, moments=moments)["faces"]}
        arrays["relative"] = np.empty((count, ENTRIES * self.slacks))
        shared = located(arrays)
        for batch in self._batches:
            batch.relate(count, shared)
        return {"relative": arrays["relative"]}

    def _shared_arrays(self, inputs: Arrays) -> Arrays:
        """Return the inputs of elements that are computed once for all of them."""
        shared = self._shared(**{name: inputs[name] for name in ("deviations", "moments")}) | self._values
        if "reactions" in inputs:
            shared["load"] = inputs["reactions"].sum(axis=1, keepdims=True)
        return shared

    def _summed(self, terms: Arrays, inputs: Arrays, *, newton: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the blocks of Q (n, 36 * mover), those between two movers (n, 36 * coupling), and the pull (n, 6 * mover)."""
        layout, count = self._layout, len(inputs["newton"])
        (Q, between), pull = self._blocks("Q", terms), layout.mover_sum(terms["pull"])
        if newton:
            curvature, curvature_between = self._blocks("curvature", terms)
            convex = np.empty((count, self._size // FREEDOMS))
            self._movers.factor(count, located({"Q": Q, "curvature": curvature, "convex": convex}))
            counts = (inputs["newton"] != 0) & (convex > 0).all(axis=1, keepdims=True)
            Q, between = Q + np.where(counts, curvature, 0), between + np.where(counts, curvature_between, 0)
            pull = pull + np.where(counts, layout.mover_sum(terms["hold"]), 0)
        if self._projects:
            nearness, nearness_between = self._blocks("nearness", terms)
            Q, between = Q + inputs["caution"] * nearness, between + inputs["caution"] * nearness_between
        return Q, between, pull

    def _blocks(self, name: str, terms: Arrays) -> tuple[np.ndarray, np.ndarray]:
        """Return the sums of the blocks of elements, by mover and by pair of coupled movers."""
        return self._layout.mover_sum(terms[name]), self._layout.coupling_sum(terms[f"{name}_between"])


def _kinds(nominal: Nominal, group: Group, method: Method, standing: Standing, *, projects: bool) -> list[Elements]:
    """Return the elements by their kinds."""
    elements = elements_of(nominal, group, standing)
    kinds: dict[object, list] = {}
    for element in elements:
        kinds.setdefault(element.kind, []).append(element)
    numbers = Numbers.of(elements)
    return [Elements(members, element_functions(members[0], method, projects=projects), numbers) for members in kinds.values()]


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
