"""The rows and the objective of a group of many bodies, pair by pair: pairs of one kind share Functions.

The objective is a sum over the pairs and the parts of a group, and the rows of a pair depend on few increments. So the terms of
a pair are a Function of its poses, points and constants, which `assemble` calls for each pair of this kind. A tower of thirty
blocks is compiled as fast as a tower of six. Up to rounding, the results are equal to the results of contact_rows and
quadratic_terms for the whole group (tests/units/compilation/test_pair_terms.py).
"""

from collections.abc import Callable, Hashable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import casadi as ca
import numpy as np

from tolcontact.compilation.qp_terms import Call, QuadraticTerms, Rows, contact_rows, quadratic_terms, relative_poses
from tolcontact.mechanics.correction import FREEDOMS, Motion, linear
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.gap import RowPoints
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.groups import Group
from tolcontact.mechanics.objective import objective_scale
from tolcontact.mechanics.pair_gaps import pair_gaps
from tolcontact.mechanics.pose import Pose, poses_of
from tolcontact.method import Method

MIN_MOVERS = 6  # smaller groups have Functions without calls
COLUMNS = ("gaps", "filled", "compliance", "relative")
POINTS = ("P_m", "P_r", "n_r")
TERMS = ("Q", "gradient", "curvature", "augmented_gradient", "proximal_hessian")

Inputs = Mapping[str, ca.SX]


def is_summed(group: Group, method: Method) -> bool:
    """Return whether a group has many bodies, and its objective is a sum over its pairs and parts."""
    return (method.minimizes.presses or method.regularization == "points") and len(group.free) >= MIN_MOVERS


def summed_terms(
    system: GroupEquations,
    points_of_pairs: Sequence[RowPoints],
    poses: Sequence[Pose],
    reactions: ca.SX,
    call: Call,
    *,
    projects: bool,
) -> tuple[Rows, QuadraticTerms]:
    """Return the rows and the terms of a group about `poses`, see contact_rows and quadratic_terms."""
    size, load = system.z.numel(), ca.sum1(reactions)
    scale = objective_scale(system.group, system.method, system.moments)
    parts = replace(system, group=replace(system.group, pairs=(), sides=()), faces=(), heights=(), scale=scale)
    motion, nothing = parts.motion(poses), ca.SX(0, 1)
    no_rows = contact_rows(parts, [], poses, motion.by(linear), nothing)
    terms = quadratic_terms(parts, no_rows, motion, nothing, load, projects=projects)
    sums = {name: getattr(terms, name) for name in TERMS}
    pairs, rows = list[int](), {name: [getattr(no_rows, name)] for name in ("slopes", *COLUMNS)}
    for index, points in enumerate(points_of_pairs):
        pair, count = _Pair.of(system, index), points.compliance.numel()
        z, inputs = pair.increments, pair.inputs(points, poses)
        of_rows = {"reactions": reactions[len(pairs) : len(pairs) + count], "load": load, "scale": scale}
        *values, slopes, gaps, filled = pair.call(call, "pair_terms", partial(pair.terms, projects=projects), inputs | of_rows)
        for name, value in zip(TERMS, values, strict=True):
            sums[name][(z, z) if value.size2() > 1 else z] += value
        rows["slopes"].append(ca.SX(count, size))
        rows["slopes"][-1][:, z] = slopes
        at_ends = {name: inputs[name] for name in ("poses", "constants", "faces")} | {"z": system.z[z]}
        (relative,) = pair.call(call, "linearized", pair.linearized, at_ends)
        for name, column in zip(COLUMNS, (gaps, filled, points.compliance, relative), strict=True):
            rows[name].append(column)
        pairs += [index] * count
    columns = {name: ca.vertcat(*values) for name, values in rows.items()}
    return replace(no_rows, pairs=np.array(pairs), **columns), QuadraticTerms(**sums, scale=scale)


@dataclass(frozen=True, eq=False)
class _Pair:
    """A pair of a group, with the parts that its increments move.

    parts    positions of the parts in the whole group
    movers   indices of the movers in the whole group
    sides    indices of the sides of the pair
    group    the group of these parts alone
    """

    system: GroupEquations
    index: int
    parts: tuple[int, ...]
    movers: tuple[int, ...]
    sides: tuple[int, ...]
    group: Group

    @classmethod
    def of(cls, system: GroupEquations, index: int) -> "_Pair":
        """Return a pair, given by its position in the group."""
        group, contact = system.group, system.nominal.pairs[system.group.pairs[index]]
        ends = [group.position(part) for part in (contact.moving, contact.reference) if part is not None]
        movers = tuple(sorted({mover for part in ends for mover in group.mobilities[part].movers}))
        parts = tuple(sorted({*ends, *(group.position(group.free[mover]) for mover in movers)}))
        sides = tuple(k for k, side in enumerate(group.sides) if side.pair == index)
        mobilities = [group.mobilities[part] for part in parts]
        alone = replace(
            group,
            parts=tuple(group.parts[part] for part in parts),
            free=tuple(group.free[mover] for mover in movers),
            mobilities=tuple(replace(m, movers=tuple(movers.index(mover) for mover in m.movers)) for m in mobilities),
            pairs=(group.pairs[index],),
            sides=tuple(replace(group.sides[k], pair=0, part=parts.index(group.sides[k].part)) for k in sides),
            loads=(),
            bilateral=(),
        )
        return cls(system, index, parts, movers, sides, alone)

    @property
    def increments(self) -> list[int]:
        """The indices of its increments among the increments of the group."""
        return [FREEDOMS * mover + k for mover in self.movers for k in range(FREEDOMS)]

    @property
    def kind(self) -> Hashable:
        """What distinguishes its equations from the equations of other pairs, except for their inputs."""
        group, contact = self.group, self.system.nominal.pairs[self.group.pairs[0]]
        return (
            tuple(mobility.movers for mobility in group.mobilities),
            tuple(side.part for side in group.sides),
            tuple(None if part is None else group.position(part) for part in (contact.moving, contact.reference)),
            tuple(face is not None for face in self.system.faces[self.index]),
            pair_gaps(contact).key,
        )

    def inputs(self, points: RowPoints, poses: Sequence[Pose]) -> dict[str, ca.SX]:
        """Return the inputs of its equations. Its constants are centres of its parts, and centre and moments of each side."""
        system, group = self.system, self.group
        sides = [values for side in group.sides for values in (side.centre, side.all_moments)]
        constants = [*(mobility.centre for mobility in group.mobilities), *sides]
        *places, filled = zip(*points.points, strict=True) if points.points else [()] * 4
        return {
            "poses": ca.vertcat(*(poses[part].vector() for part in self.parts)),
            "raw": ca.vertcat(*(system.raw[part].vector() for part in self.parts)),
            "moments": system.moments[:, list(self.sides)],
            "regularization_factor": system.regularization_factor,
            "constants": ca.SX(ca.DM(np.concatenate([np.ravel(values) for values in constants]))),
            "faces": ca.vertcat(ca.SX(0, 1), *(X.vector() for X in system.faces[self.index] if X is not None)),
            "heights": system.heights[self.index],
            "compliance": ca.sparsify(points.compliance),
            **{name: ca.horzcat(ca.SX(3, 0), *columns) for name, columns in zip(POINTS, places, strict=True)},
            "filled": ca.vertcat(ca.SX(0, 1), *(() if points.bend is None else filled)),
            "bend": ca.SX(0, 1) if points.bend is None else points.bend,
        }

    def call(self, call: Call, name: str, expression: Callable[[Inputs], Sequence[ca.SX]], inputs: Inputs) -> Sequence[ca.SX]:
        """Return the results of an expression of inputs by name."""

        def results(*symbols: ca.SX) -> Sequence[ca.SX]:
            return expression(dict(zip(inputs, symbols, strict=True)))

        return call(name, results, *inputs.values(), kind=self.kind)

    def linearized(self, inputs: Inputs) -> list[ca.SX]:
        """Return X_RM (12, 1) to first order in the increments."""
        equations, motion = self._equations(inputs)
        ((start, by_z),) = relative_poses(equations, motion.poses, motion.by(linear))
        return [start.vector() + by_z @ equations.z]

    def terms(self, inputs: Inputs, *, projects: bool) -> list[ca.SX]:
        """Return the terms of its sides, and slopes, gaps and filled of the rows of its points."""
        equations, motion = self._equations(inputs)
        has_slots = inputs["bend"].numel() > 0
        columns = [ca.horzsplit(inputs[name]) if inputs[name].numel() else [] for name in POINTS]
        filled = ca.vertsplit(inputs["filled"]) if has_slots else [ca.SX(1)] * len(columns[0])
        points = RowPoints([*zip(*columns, filled, strict=True)], inputs["compliance"], inputs["bend"] if has_slots else None)
        rows = contact_rows(equations, [points], motion.poses, motion.by(linear), inputs["reactions"])
        terms = quadratic_terms(equations, rows, motion, inputs["reactions"], inputs["load"], projects=projects)
        return [*(getattr(terms, name) for name in TERMS), rows.slopes, rows.gaps, rows.filled]

    def _equations(self, inputs: Inputs) -> tuple[GroupEquations, Motion]:
        group = self.group
        sizes = [3] * len(group.mobilities) + [3, MOMENTS] * len(group.sides)
        symbols = iter(ca.vertsplit(inputs["constants"], [0, *np.cumsum(sizes).tolist()]))
        mobilities = tuple(replace(mobility, centre=next(symbols)) for mobility in group.mobilities)
        sides = tuple(replace(side, centre=next(symbols), all_moments=next(symbols)) for side in group.sides)
        deviating = iter(poses_of(inputs["faces"]) if inputs["faces"].numel() else [])
        moving, reference = (None if face is None else next(deviating) for face in self.system.faces[self.index])
        nothing = ca.SX(0, 1)
        equations = GroupEquations(
            self.system.nominal,
            replace(group, mobilities=mobilities, sides=sides),
            self.system.method,
            raw=poses_of(inputs["raw"]) if "raw" in inputs else (),
            moments=inputs.get("moments", nothing),
            deviations=nothing,
            regularization_factor=inputs.get("regularization_factor", nothing),
            z=inputs.get("z", ca.SX.sym("z", FREEDOMS * len(self.movers))),
            faces=[(moving, reference)],
            heights=[inputs.get("heights", nothing)],
            steps=(),
            scale=inputs.get("scale"),
        )
        return equations, equations.motion(poses_of(inputs["poses"]))
