"""The contact QP of a group of many bodies, assembled from its elements."""

from collections.abc import Hashable, Sequence
from typing import TypeVar

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.compilation.conditioning import SLACK, slack_owners
from tolcontact.compilation.contact_qp import Evaluators, Standing, row_spans
from tolcontact.compilation.contact_rows import standing_points
from tolcontact.compilation.elements.element import Element
from tolcontact.compilation.elements.element_batch import Arrays, ElementBatch, Elements
from tolcontact.compilation.elements.element_functions import function_of
from tolcontact.compilation.elements.element_layout import ElementLayout
from tolcontact.compilation.elements.mover_functions import CorrectedPoses
from tolcontact.compilation.elements.pair_element import FirstIndices, PairElement, PairElements, pair_elements, pair_functions
from tolcontact.compilation.elements.part_element import PartElement, PartElements, part_elements, part_functions
from tolcontact.compilation.functions import NamedFunction, flat, located
from tolcontact.compilation.outcome import step_share
from tolcontact.compilation.plugins import Plugin
from tolcontact.discretization import Nominal
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.gap import GapMap
from tolcontact.mechanics.group_equations import face_heights, face_poses
from tolcontact.mechanics.groups import Group, curved_pairs
from tolcontact.mechanics.objective import objective_scale
from tolcontact.mechanics.placement import bilateral_steps
from tolcontact.mechanics.pose import ENTRIES
from tolcontact.method import Method

MIN_MOVERS_FOR_ELEMENTS = 6  # smaller groups are not assembled from elements
MAX_ENTRIES = 1_000_000  # of the terms of all elements in a batch of realizations


E = TypeVar("E", bound=Element)


def has_elements(group: Group, method: Method) -> bool:
    """Return whether a group has many bodies, and its objective is a sum over its pairs and parts."""
    is_sum = method.minimizes.presses or method.regularization == "points"
    return is_sum and len(group.free) >= MIN_MOVERS_FOR_ELEMENTS


class ElementQP:
    """The QP of a group, like ContactQP, from functions of its elements.

    slacks, has_springs, equations, standing, plugin, spans   as in ContactQP
    """

    def __init__(
        self, nominal: Nominal, group: Group, gaps: Sequence[GapMap | None], method: Method, plugin: Plugin, standing: Standing
    ) -> None:
        self.plugin, self._method = plugin, method
        self.standing = standing or [standing_points(nominal.pairs[k], gaps[k], method) for k in group.pairs]
        self.spans, self._pairs, self.has_springs = row_spans(self.standing), len(group.pairs), group.has_springs
        self._projects = method.is_iterated or bool(curved_pairs(nominal, group))
        self._size = FREEDOMS * len(group.free)
        pairs, parts = pair_elements(nominal, group, self.standing), part_elements(nominal, group, method)
        kinds = _kinds(pairs, parts, method, projects=self._projects)
        is_priced = _priced_slacks(pairs)
        self.slacks, self.equations = len(is_priced), sum(part.equations for part in parts)
        self._prices = np.where(is_priced, float(group.length), 0.0)
        rows = self.spans[-1].stop + self.equations
        self._layout = ElementLayout(kinds, movers=len(group.free), rows=rows, slacks=self.slacks)
        self._batches = [
            ElementBatch.of(elements, columns) for elements, columns in zip(kinds, self._layout.columns, strict=True)
        ]
        self._movers = self._layout.of_movers()
        self._corrected_poses = CorrectedPoses(group, method)
        self._shared = _shared_function(nominal, group, method)
        self._share = _share_function(self._size)
        self._values = {
            name: np.full((1, 1), float(value)) for name, value in (("length", group.length), ("count", group.count))
        }
        self._no_moments = np.zeros((1, MOMENTS * len(group.sides)))

    @property
    def kinds(self) -> int:
        """The number of kinds of elements; each kind has its own functions."""
        return len(self._batches)

    @property
    def max_batch(self) -> int:
        """The number of realizations in a batch, so that their terms take little memory."""
        kinds = [batch.elements for batch in self._batches]
        entries = sum(len(kind) * kind.size * (2 * kind.size + ENTRIES) for kind in kinds)
        return max(16, MAX_ENTRIES // entries)

    @property
    def evaluators(self) -> Evaluators:
        """The functions of the QP."""
        return Evaluators(self.assemble, self.finish, self.energy, self.relate)

    def sparsity(self, name: str) -> ca.Sparsity:
        """Return the sparsity of h, g, a or lba."""
        if name in ("h", "a"):
            return self._layout.matrices[name].sparsity
        return ca.Sparsity.dense(self._size + self.slacks if name == "g" else self.spans[-1].stop + self.equations, 1)

    def assemble(self, **inputs: Float[Array, "realization _"]) -> Arrays:
        """Return h, g, a, lba and uba, and further arrays for `finish`, from the inputs of contact_qp."""
        count, layout, rows = len(inputs["poses"]), self._layout, self.spans[-1].stop
        newton = self._method.is_exact and bool(inputs["newton"].any())
        filled = np.ones((count, rows))
        filled[:, layout.slot_rows] = inputs["filled"]
        arrays = inputs | self._shared_arrays(inputs) | {"filled": filled, "gaps": np.empty((count, rows))}
        lower, row_length = np.empty((count, rows + self.equations)), np.empty((count, rows))
        terms = {name: np.empty((count, size)) for name, size in layout.sizes_of_terms.items()}
        shared = located(arrays | terms | {"lower": lower})
        arrays_of_batches = [shared | batch.arrays(inputs["deviations"]) for batch in self._batches]
        for batch, batch_arrays in zip(self._batches, arrays_of_batches, strict=True):
            batch.evaluate("newton" if newton else "terms", count, batch_arrays)
        Q, between, gradient = self._summed(terms, inputs, newton=newton)
        V, h, a = (np.ones((count, size)) for size in (Q.shape[1], len(layout.matrices["h"]), len(layout.matrices["a"])))
        g = np.empty((count, self._size + self.slacks))
        g[:, self._size :] = self._prices
        self._movers.whiten(count, located({"Q": Q, "gradient": gradient, "V": V, "g": g}))
        self._movers.couple(count, located({"Q": between, "V_i": V, "V_j": V, "H": h, "mirrored": h}))
        row_arrays = located({"row_length": row_length, "V": V, "a": a, "opening": a})
        for batch, batch_arrays in zip(self._batches, arrays_of_batches, strict=True):
            batch.evaluate("rows", count, batch_arrays | row_arrays)
        upper = np.full(lower.shape, np.inf)
        upper[:, rows:] = lower[:, rows:]
        return {
            "h": h, "g": g, "a": a, "lba": lower, "uba": upper, "V": V, "filled": filled, "row_length": row_length,
            **{name: arrays[name] for name in ("faces", "scale", "steps")},
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
            "residual": layout.elements, "locator_residual": layout.elements, "slack_force": self.slacks,
            "multipliers": self.spans[-1].stop, **dict.fromkeys(("linearized", "relative"), ENTRIES * self._pairs),
        }  # fmt: skip
        # Zero, since elements without rows write nothing.
        results = {name: np.zeros((count, size)) for name, size in sizes.items()}
        forces = np.zeros((count, FREEDOMS * len(layout.force_sum.positions)))
        checked = results | {"opening": arrays["a"], "y": x, "slack": x, "lam": arrays["lam_a"], "lower": arrays["lba"]}
        names = ("a", "row_length", "filled", "scale", "faces", "steps", "poses", "raw")
        checked |= {name: arrays[name] for name in names} | {"force": forces}
        initial = located(checked | self._values | {"step": steps})
        final = initial | located({"poses": corrected})
        for batch in self._batches:
            for name, values in (("check", initial), ("advance", initial), ("relate", final), ("locator_residual", final)):
                batch.evaluate(name, count, values | batch.constants)
        couplings = {"H": arrays["h"], "y_i": x, "y_j": x, "force_i": forces, "force_j": forces}
        self._movers.coupling_forces(count, located(couplings))
        force = np.concatenate([layout.force_sum(forces), results["slack_force"]], axis=1)
        stationarity = np.abs(x + arrays["g"] + force + lam_x)
        residuals = [stationarity, np.abs(np.minimum(slack, -lam_x[:, self._size :])), results["residual"]]
        return {
            "corrected": corrected,
            "linearized": results["linearized"],
            "relative": results["relative"],
            "multipliers": results["multipliers"],
            "residual": np.concatenate(residuals, axis=1).max(axis=1, keepdims=True),
            "slack": SLACK * slack[:, : self._pairs],
            "step": share["size"],
            "locator_residual": results["locator_residual"].max(axis=1, keepdims=True),
        }

    def energy(self, **inputs: Float[Array, "realization ..."]) -> Arrays:
        """Return the objective of contact_qp."""
        inputs = {name: flat(values) for name, values in inputs.items()}
        arrays = inputs | self._shared_arrays(inputs) | {"energy": np.empty((len(inputs["poses"]), self._layout.elements))}
        shared = located(arrays)
        for batch in self._batches:
            batch.evaluate("energy", len(inputs["poses"]), shared | batch.arrays(inputs["deviations"]))
        return {"energy": arrays["energy"].sum(axis=1, keepdims=True)}

    def relate(self, **inputs: Float[Array, "realization ..."]) -> Arrays:
        """Return X_RM of all pairs at `poses`."""
        poses, deviations = flat(inputs["poses"]), flat(inputs["deviations"])
        count = len(poses)
        moments = np.repeat(self._no_moments, count, axis=0)
        arrays = {"poses": poses, "faces": self._shared(deviations=deviations, moments=moments)["faces"]}
        arrays["relative"] = np.empty((count, ENTRIES * self._pairs))
        shared = located(arrays)
        for batch in self._batches:
            batch.evaluate("relate", count, shared)
        return {"relative": arrays["relative"]}

    def _shared_arrays(self, inputs: Arrays) -> Arrays:
        """Return the inputs that all elements share."""
        shared = self._shared(**{name: inputs[name] for name in ("deviations", "moments")}) | self._values
        if "reactions" in inputs:
            shared["load"] = inputs["reactions"].sum(axis=1, keepdims=True)
        return shared

    def _summed(self, terms: Arrays, inputs: Arrays, *, newton: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the diagonal blocks (n, 36 * mover) and coupling blocks (n, 36 * coupling) of Q, and the gradient.

        The gradient has the shape (n, 6 * mover).
        """
        layout, count = self._layout, len(inputs["newton"])
        (Q, between), gradient = self._blocks("Q", terms), layout.mover_sum(terms["gradient"])
        if newton:
            curvature, curvature_between = self._blocks("curvature", terms)
            convex = np.empty((count, self._size // FREEDOMS))
            self._movers.factor(count, located({"Q": Q, "curvature": curvature, "convex": convex}))
            counts = (inputs["newton"] != 0) & (convex > 0).all(axis=1, keepdims=True)
            Q, between = Q + np.where(counts, curvature, 0), between + np.where(counts, curvature_between, 0)
            gradient = gradient + np.where(counts, layout.mover_sum(terms["augmented_gradient"]), 0)
        if self._projects:
            weight = inputs["proximal_weight"]
            proximal_hessian, proximal_between = self._blocks("proximal_hessian", terms)
            Q, between = Q + weight * proximal_hessian, between + weight * proximal_between
        return Q, between, gradient

    def _blocks(self, name: str, terms: Arrays) -> tuple[np.ndarray, np.ndarray]:
        """Return the sums of the blocks of elements, by mover and by pair of coupled movers."""
        return self._layout.mover_sum(terms[name]), self._layout.coupling_sum(terms[f"{name}_between"])


def _kinds(pairs: Sequence[PairElement], parts: Sequence[PartElement], method: Method, *, projects: bool) -> list[Elements]:
    """Return the elements by their kinds."""
    firsts, rows = FirstIndices.of(pairs), sum(pair.rows for pair in pairs)
    return [
        *(PairElements(kind, pair_functions(kind[0], method, projects=projects), firsts) for kind in _by_kind(pairs)),
        *(PartElements(kind, part_functions(kind[0], method, projects=projects), rows) for kind in _by_kind(parts)),
    ]


def _by_kind(elements: Sequence[E]) -> list[list[E]]:
    """Return the elements of each kind."""
    kinds: dict[Hashable, list[E]] = {}
    for element in elements:
        kinds.setdefault(element.kind, []).append(element)
    return [*kinds.values()]


def _priced_slacks(pairs: Sequence[PairElement]) -> np.ndarray:
    """Return which slacks (slack,) have a price."""
    first_rows = FirstIndices.of(pairs).row.tolist()
    springs = [first + row for first, pair in zip(first_rows, pairs, strict=True) for row in pair.springs]
    return slack_owners(np.repeat(np.arange(len(pairs)), [pair.rows for pair in pairs]), springs, len(pairs))[1]


def _shared_function(nominal: Nominal, group: Group, method: Method) -> NamedFunction:
    """Return the function (deviations, moments) -> faces, heights, steps, scale, which elements take as inputs."""
    inputs = {
        "deviations": ca.SX.sym("deviations", len(nominal.contributors)),
        "moments": ca.SX.sym("moments", MOMENTS, len(group.sides)),
    }
    pairs = [nominal.pairs[index] for index in group.pairs]
    poses = [pose.vector() for pair in pairs for pose in face_poses(pair, inputs["deviations"]) if pose is not None]
    heights = [face_heights(pair, inputs["deviations"]) for pair in pairs]
    steps = [bilateral_steps(nominal, group.parts[locators.part], inputs["deviations"]) for locators in group.bilateral]
    outputs = {
        "faces": ca.vertcat(ca.SX(0, 1), *poses),
        "heights": ca.vertcat(*heights),
        "steps": ca.vertcat(ca.SX(0, 1), *steps),
        "scale": objective_scale(group, method, inputs["moments"]),
    }
    return NamedFunction.dense(ca.Function("shared", [*inputs.values()], [*outputs.values()], [*inputs], [*outputs]))


def _share_function(size: int) -> NamedFunction:
    """Return the function (step, y, stride, length) -> share of the step that is taken, and the size of the whole step."""
    inputs = {
        "step": ca.SX.sym("step", size),
        "y": ca.SX.sym("y", size),
        "stride": ca.SX.sym("stride"),
        "length": ca.SX.sym("length"),
    }
    share = step_share(inputs["step"], inputs["stride"], inputs["length"])
    step_size = ca.vertcat(ca.norm_inf(inputs["step"]), ca.norm_inf(inputs["y"]))
    return function_of("share", inputs, {"share": share, "size": step_size})
