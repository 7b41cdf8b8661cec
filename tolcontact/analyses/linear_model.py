"""The first-order model at the nominal assembly, as matrices: for nominal sensitivities, and for bounds of measures.

Bounds are over everything that drawings allow: in this model no pose free of penetration lies beyond.
With any objective, gaps are non-negative at the corrected pose, and bilateral locators keep their positions where forces press.
So the largest value of a measure over all deviations and all these poses is a linear program. Its zones are approximated by
tangents (Kelley, 1960), and each round gives an outer bound of the measure. This is the worst case with float of fasteners.
Where only the objective holds a part, for instance a part that contact may lift without limit, the bound is infinite.

The objective "all points" has the same quadratic term everywhere. Here the optimality conditions are added to the program, with
a binary variable for each row that may be active or open; HiGHS also gives a bound for this program when its time is up.

A measure with a kink at the nominal assembly (a minimum, a clearance, an angle that is nominally 0) has no linear model, and
no bound. A kink is judged by effects, slopes times three standard deviations, since slopes in different units differ.

The bounds are of first order in deviations and motions. Pairs of round faces and springy supports have no rows, which only
widens the bounds.
"""

import itertools
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.analyses.allowed_space import AllowedRegion
from tolcontact.compilation import Program
from tolcontact.mechanics import Group

MAX_DIFFERENCE = 0.1  # of the largest effect on a measure: if forward and backward effects differ by more, there is a kink
MIN_SLOPE = 1e-6  # of a measure: smaller ones are rounding
SEED, SAMPLES, THREE_SIGMA = 1, 256, 3.0  # of the deviations that tell how far contributors vary
STEP = 1e-4  # mm, and rad times the length of a group: steps of central differences; second-order terms cancel
MIN_STEP, MAX_STEP = 1e-5, 1.0  # of three standard deviations of a contributor: bounds of its step, in its units
MAX_ROUNDS = 30
SLACK = 1e-7  # of a zone's width
MAX_BINARY, MAX_SECONDS = 64, 30.0  # rows that may be active or open; time for one bound
MAX_CONDITION = 1e8  # of the objective's quadratic term: above this, contact points do not constrain all freedoms


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Measures and gaps for deviations d (contributor,), and a motion y of the free parts from their poses at d.

    A motion is (dt, L w) of each free part: a translation of its centre [mm], and a rotation times the length L of its group
    [mm].

    measures         (measure,) nominally
    by_deviations    (measure, contributor)
    by_motion        (measure, freedom)
    kinked           (2, measure): whether the nominal assembly is at a kink of the measure, by deviations, by motions; there it
                     has no derivatives
    gaps             (row,) nominally: of the contact points that can be the deepest, of pairs of flat faces
    gaps_by_deviations, gaps_by_motion   (row, contributor), (row, freedom)
    bilateral        (row, freedom): motions that bilateral locators constrain to 0, if the objective is seating
    displacements    (row, freedom): of all contact points, scaled so that the sum of squares is the objective "all points"
    round_pairs      number of pairs of round faces, which have no rows here
    """

    measures: np.ndarray
    by_deviations: np.ndarray
    by_motion: np.ndarray
    kinked: np.ndarray
    gaps: np.ndarray
    gaps_by_deviations: np.ndarray
    gaps_by_motion: np.ndarray
    bilateral: np.ndarray
    displacements: np.ndarray
    round_pairs: int


def linear_model(program: Program) -> LinearModel:
    """Return the linear model of a program, by central differences of its Functions."""
    count, reaches = len(program.nominal.contributors), _reaches(program)
    steps = np.where(reaches > 0, np.clip(STEP, MIN_STEP * reaches, MAX_STEP * reaches), STEP)
    placed = [program.place(deviations=sign * np.diag(steps))["poses"] for sign in (1, -1)]
    varied = [_observed(program, poses, sign * np.diag(steps)) for poses, sign in zip(placed, (1, -1), strict=True)]
    moved = [
        _observed(program, poses, np.zeros((len(poses), count))) for poses in (_motions(program, 1), _motions(program, -1))
    ]
    (measures,), (gaps,) = _observed(program, _at_rest(program, 1), np.zeros((1, count)))
    by_deviations, by_motion = (
        [(ahead - behind).T / (2 * step) for ahead, behind in zip(*sides, strict=True)]
        for sides, step in ((varied, steps), (moved, STEP))
    )
    kinked = np.array([
        _kinks(ahead[0] - measures, behind[0] - measures, weights)
        for (ahead, behind), weights in ((varied, reaches / steps), (moved, np.ones(len(_freedoms(program)))))
    ])  # fmt: skip
    return LinearModel(
        measures, by_deviations[0], by_motion[0], kinked, gaps, by_deviations[1], by_motion[1], _bilateral_motions(program),
        _displacements(program), sum(gaps is None for gaps in program.gaps),
    )  # fmt: skip


def total_derivatives(program: Program) -> np.ndarray:
    """Return derivatives (measure, contributor) of the raw measures at the nominal assembly.

    The derivative with respect to a shared cause includes the contributors that it drives. Derivatives are NaN for a measure
    with a kink at the nominal assembly.
    """
    model = linear_model(program)
    by_deviations = np.where(model.kinked[0][:, None], np.nan, model.by_deviations)
    matrix = program.draws.drive_matrix
    return by_deviations + by_deviations @ matrix.T if matrix.any() else by_deviations


def _reaches(program: Program) -> np.ndarray:
    """Return three standard deviations (contributor,) of all deviations in the contributors' units; 0 for constant ones."""
    deviations = program.draws(seed=SEED, start=0, stop=SAMPLES)
    return np.asarray(np.where(np.ptp(deviations, axis=0) > 0, THREE_SIGMA * deviations.std(axis=0), 0.0))


def _kinks(ahead: np.ndarray, behind: np.ndarray, weights: np.ndarray) -> np.ndarray:
    """Return whether each measure has a kink (measure,), from its changes (n, measure) by forward and backward steps.

    Weights (n,) are ranges in steps. At a kink the forward and the backward change times the weight differ by more than a
    share of the largest of these effects, or one is not a number.
    """
    differences, weights = np.abs(ahead + behind), weights[:, None]
    largest = (weights * np.maximum(np.abs(ahead), np.abs(behind))).max(axis=0, initial=0.0)
    is_small = weights * differences <= MAX_DIFFERENCE * largest
    return ~(is_small | (differences <= MAX_DIFFERENCE * STEP * MIN_SLOPE)).all(axis=0)


def leverages(program: Program) -> np.ndarray:
    """Return the leverage (contributor,) of each locator; NaN for other contributors.

    The leverage is the largest nominal displacement of any vertex of the part, or of its joint, for 1 mm. It is 1 for three
    locators on a plane that span the whole part, and increases as they move closer together.
    """
    nominal, count = program.nominal, len(program.nominal.contributors)
    leverages = np.full(count, np.nan)
    placed = (program.place(deviations=sign * STEP * np.eye(count))["poses"] for sign in (1, -1))
    ahead, behind = (poses.reshape(count, len(nominal.parts), pose.ENTRIES) for poses in placed)
    for number in range(len(nominal.parts)):
        columns = nominal.columns(number)
        joined = [k for k, other in enumerate(nominal.parts) if other.carried and other.parent == number]
        displacements = [
            pose.apply(ahead[columns, k], nominal.parts[k].vertices) - pose.apply(behind[columns, k], nominal.parts[k].vertices)
            for k in (number, *joined)
        ]
        lengths = np.linalg.norm(np.concatenate(displacements, axis=1), axis=-1)
        leverages[columns] = lengths.max(axis=-1, initial=0) / (2 * STEP)
    return leverages


def _observed(program: Program, poses: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return measures (n, measure), not a number where infinite, and gaps (n, row) at poses (n, part * 12)."""
    measured, relative = program.observed(poses, deviations)
    measured = np.where(np.isfinite(measured), measured, np.nan)
    rows = []
    for k, (pair, gaps) in enumerate(zip(program.nominal.pairs, program.gaps, strict=True)):
        if pair.samples_faces and not pair.is_springy:  # springs permit penetration
            by_pose, by_deviations = np.split(gaps.coordinates[:, gaps.corners], [gaps.basis.shape[1]])
            entries = np.column_stack([relative[:, k], np.ones(len(poses))])
            rows.append(entries @ gaps.basis @ by_pose + deviations[:, gaps.columns] @ by_deviations)
    return measured, np.column_stack([np.zeros((len(poses), 0)), *rows])


def _at_rest(program: Program, count: int) -> np.ndarray:
    return np.tile(pose.AT_REST, (count, len(program.nominal.parts)))


def _freedoms(program: Program) -> list[tuple[Group, int, int]]:
    """Return all freedoms: group, position of the mover among its free parts, axis (0 to 2 translations, 3 to 5 rotations)."""
    groups = [compiled.group for compiled in program.groups]
    return [(group, mover, axis) for group in groups for mover in range(len(group.free)) for axis in range(6)]


def _moves(group: Group, mover: int, axis: int, points: np.ndarray) -> np.ndarray:
    """Return displacements (point, 3) for a step 1 of a freedom."""
    centre = group.mobilities[group.position(group.free[mover])].centre
    unit = np.eye(3)[axis % 3]
    return np.broadcast_to(unit, points.shape) if axis < 3 else np.cross(unit / group.length, points - centre)


def _motions(program: Program, sign: int) -> np.ndarray:
    """Return poses (freedom, part * 12), each with a small step of one freedom."""
    freedoms = _freedoms(program)
    poses = _at_rest(program, len(freedoms)).reshape(len(freedoms), len(program.nominal.parts), pose.ENTRIES)
    for row, (group, mover, axis) in enumerate(freedoms):
        origin, *ends = _moves(group, mover, axis, np.vstack([np.zeros(3), np.eye(3)]))
        turn = np.column_stack([end - origin for end in ends])
        for part, mobility in zip(group.parts, group.mobilities, strict=True):
            if mover in mobility.movers:
                poses[row, part] += sign * STEP * np.concatenate([turn.ravel(), origin])
    deviations = np.zeros((len(freedoms), len(program.nominal.contributors)))
    for station in program.stations:
        if station.place is not None:  # a motion in an earlier station moves the parts that it hands on
            placed = station.place(poses=poses[:, station.sources], deviations=deviations)["placed"]
            poses[:, station.parts] += placed.reshape(len(freedoms), -1, pose.ENTRIES) - pose.AT_REST
    return poses.reshape(len(freedoms), pose.ENTRIES * len(program.nominal.parts))


def _bilateral_motions(program: Program) -> np.ndarray:
    """Return the displacements (row, freedom) of bilateral locators along their directions, if the objective is seating."""
    if not program.method.minimizes.presses:
        return np.zeros((0, len(_freedoms(program))))
    rows = []
    for compiled in program.groups:
        for number, part in enumerate(compiled.group.free):
            nominal = program.nominal.parts[part]
            exact = nominal.locators.exact
            for p, n in zip(nominal.locators.points[exact], nominal.locators.directions[exact], strict=True):
                rows.append([  # a motion of a part that supports this one also moves its locators
                    n @ _moves(group, mover, axis, p[None])[0] if group is compiled.group and mover == number else 0.0
                    for group, mover, axis in _freedoms(program)
                ])  # fmt: skip
    return np.array(rows).reshape(-1, len(_freedoms(program)))


def _displacements(program: Program) -> np.ndarray:
    """Return the scaled displacements (row, freedom) of all contact points."""
    freedoms, rows = _freedoms(program), []
    for compiled in program.groups:
        count = sum(len(side.points) for side in compiled.group.sides)
        for side in compiled.group.sides:
            movers, points = compiled.group.mobilities[side.part].movers, side.spread_points
            columns = [
                _moves(group, mover, axis, points).ravel() / np.sqrt(2 * count * len(points) / len(side.points))
                if group is compiled.group and mover in movers
                else np.zeros(points.size)
                for group, mover, axis in freedoms
            ]
            rows.append(np.column_stack(columns))
    return np.vstack([np.zeros((0, len(freedoms))), *rows])


def farthest_poses(program: Program, region: AllowedRegion, model: LinearModel) -> np.ndarray:
    """Return bounds (measure, state, end); bounds of the raw state are without contact."""
    bounds = np.empty((len(model.measures), len(terms.STATES), len(terms.ENDS)))
    # With stations, reactions in a later one do not act on the motions in an earlier one.
    has_optimum = program.method.objective == "all points" and not program.stations
    problems = [_Problem(model, region), _Problem(model, region, is_moved=True, has_optimum=has_optimum)]
    for measure, (end, sense) in itertools.product(range(len(model.measures)), enumerate(terms.SENSES)):
        unbounded = model.kinked[0, measure], model.kinked[:, measure].any()
        bounds[measure, :, end] = [
            sense * np.inf if is_unbounded else model.measures[measure] + sense * problem.bound(measure, sense)
            for problem, is_unbounded in zip(problems, unbounded, strict=True)
        ]
    return bounds


class _Problem:
    """Linear constraints on points x of the region, with motions y if `is_moved`.

    The optimality conditions of the objective "all points" add reactions r, and binaries b of active (1) or open (0) rows.
    """

    def __init__(
        self, model: LinearModel, region: AllowedRegion, *, is_moved: bool = False, has_optimum: bool = False
    ) -> None:  # fmt: skip
        self._region, self._model = region, model
        self._freedoms = model.by_motion.shape[1] if is_moved else 0
        limits = self._limits() if has_optimum else None
        contributors, binaries = len(region.lower), 0 if limits is None else len(model.gaps)
        self._width = contributors + self._freedoms + 2 * binaries
        self._integer = np.r_[np.zeros(self._width - binaries), np.ones(binaries)]
        # The solver's tolerances are absolute: variables are multiples of half ranges, a length and the largest reactions.
        halves = (region.upper - region.lower) / 2
        motions = np.full(self._freedoms, _length(region.slopes(model.gaps_by_deviations) * halves))
        reactions = np.zeros(0) if limits is None else limits[1]
        self._scales = np.concatenate([np.where(halves > 0, halves, 1.0), motions, reactions, np.ones(binaries)])
        lower, upper = np.full(self._width, -np.inf), np.full(self._width, np.inf)
        lower[:contributors], upper[:contributors] = region.lower, region.upper
        self._constraints: list[scipy.optimize.LinearConstraint] = []
        gaps = np.hstack([region.slopes(model.gaps_by_deviations), model.gaps_by_motion])
        if self._freedoms:  # gaps are non-negative, and bilateral locators keep their positions
            self._constraints += self._rows(gaps, -model.gaps, np.inf)
            self._constraints += self._rows(np.hstack([np.zeros((len(model.bilateral), contributors)), model.bilateral]), 0, 0)
        if limits is not None:
            largest_gap, largest_reaction = limits
            lower[-2 * binaries :], upper[-2 * binaries :] = 0.0, np.r_[largest_reaction, np.ones(binaries)]
            eye, zeros = np.eye(binaries), np.zeros((binaries, binaries))
            # Reactions balance the objective's gradient; a row is active only if its gap is closed.
            balance = np.hstack([np.zeros((self._freedoms, contributors)), _hessian(model), -model.gaps_by_motion.T])
            self._constraints += self._rows(balance, 0, 0)
            self._constraints += self._rows(np.hstack([np.zeros_like(gaps), eye, -largest_reaction * eye]), -np.inf, 0)
            self._constraints += self._rows(np.hstack([gaps, zeros, largest_gap * eye]), -np.inf, largest_gap - model.gaps)
        self._bounds = scipy.optimize.Bounds(lower / self._scales, upper / self._scales)

    def _limits(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return bounds of gaps at a corrected pose (row,) [mm], and of reactions (row,).

        The result is None if there are too many rows, if contact points do not constrain all freedoms, or if no motion opens
        all gaps.
        """
        model, region = self._model, self._region
        A, hessian = model.gaps_by_motion, _hessian(model)
        if not 0 < len(A) <= MAX_BINARY or model.round_pairs or np.linalg.cond(hessian) >= MAX_CONDITION:
            return None
        # A motion d that opens all gaps by 1, with the least sum of |d|: nearly the least energy suffices.
        lift = scipy.optimize.linprog(np.ones(2 * A.shape[1]), -np.hstack([A, -A]), -np.ones(len(A)))
        if not lift.success:
            return None
        d = np.subtract(*np.split(lift.x, 2))
        energy = float(np.sqrt(d @ hessian @ d))
        slopes = region.slopes(model.gaps_by_deviations)
        centre, reach = (region.lower + region.upper) / 2, np.abs(slopes) @ ((region.upper - region.lower) / 2)
        lowest, highest = model.gaps + slopes @ centre - reach, model.gaps + slopes @ centre + reach
        deepest = max(float(-lowest.min()), 0.0)
        # The corrected motion has no more energy than `deepest` d, which opens all gaps; this also bounds the sum of reactions.
        opening = np.sqrt(np.einsum("ij,jk,ik->i", A, np.linalg.inv(hessian), A)) * deepest * energy
        return np.maximum(highest + opening, 1e-9), np.full(len(A), max(deepest, 1e-9) * energy**2)

    def _rows(self, rows: np.ndarray, lower: np.ndarray | float, upper: np.ndarray | float) -> list[Any]:
        """Return the constraint with rows (row, variable) of the first variables; nothing if there are no rows.

        Each row is scaled so that its largest coefficient of a scaled variable is 1.
        """
        padded = np.pad(rows, ((0, 0), (0, self._width - rows.shape[1]))) * self._scales
        largest = np.abs(padded).max(axis=1, initial=0.0)
        factors = 1 / np.where(largest > 0, largest, 1.0)
        constraint = scipy.optimize.LinearConstraint(padded * factors[:, None], lower * factors, upper * factors)
        return [constraint] if len(rows) else []

    def bound(self, measure: int, sense: int) -> float:
        """Return an upper bound of sense * (measure - nominal); infinite if there is none."""
        goal, contributors = np.zeros(self._width), len(self._region.lower)
        goal[:contributors] = sense * self._region.slopes(self._model.by_deviations[measure])
        goal[contributors : contributors + self._freedoms] = sense * self._model.by_motion[measure, : self._freedoms]
        goal *= self._scales
        largest = float(np.abs(goal).max(initial=0.0)) or 1.0
        constraints, bound, (planes, ends) = list(self._constraints), np.inf, self._region.planes()
        for _ in range(MAX_ROUNDS):
            constraints += self._rows(planes, -np.inf, ends)
            # With presolve, HiGHS prints a line when an integer solution needs another solve in the space of all variables.
            solution = scipy.optimize.milp(
                -goal / largest, constraints=constraints, bounds=self._bounds, integrality=self._integer,
                options={"time_limit": MAX_SECONDS, "presolve": not self._integer.any()},
            )  # fmt: skip
            if solution.x is None:
                break
            bound = min(bound, -largest * float(solution.mip_dual_bound if self._integer.any() else solution.fun))
            planes, ends = self._region.planes((solution.x * self._scales)[:contributors], SLACK)
            if not len(planes):
                break
        return bound


def _length(gap_changes: np.ndarray) -> float:
    """Return the largest sum of changes [mm] of a gap, from the largest changes (row, contributor); 1 mm if there are none."""
    return float(np.abs(gap_changes).sum(axis=1).max(initial=0.0)) or 1.0


def _hessian(model: LinearModel) -> np.ndarray:
    """Return the quadratic term (freedom, freedom) of the objective "all points"."""
    return np.asarray(2 * model.displacements.T @ model.displacements)
