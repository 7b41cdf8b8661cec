"""The compiled model: built once, and evaluated by name for blocks of realizations."""

import itertools
import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.compilation.bounded_pairs import TRIAL_SEED, TRIALS, Trial, bounded_pair, push
from tolcontact.compilation.contact_qp import ContactQP, contact_qp
from tolcontact.compilation.contact_rows import MIN_SLOTS, SLOTS, standing_points
from tolcontact.compilation.contact_solver import ContactSolver
from tolcontact.compilation.functions import NamedFunction
from tolcontact.compilation.measure_accuracy import measure_accuracies
from tolcontact.compilation.solver import SolverChoice
from tolcontact.compilation.solvers import solver_choice
from tolcontact.compilation.station_program import StationProgram, station_programs
from tolcontact.declaration.locator import FIRST_ORDER
from tolcontact.declaration.measure import Tape
from tolcontact.discretization import ContactPoints, Nominal, RoundPoints, coordinates_in_words
from tolcontact.errors import ModelError
from tolcontact.geometry.meeting import Meeting
from tolcontact.interference import Watch, ordered
from tolcontact.limits import Limits
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.gap import GapMap, gap_map, gap_matrix
from tolcontact.mechanics.group_equations import face_heights, face_poses, facing_pose
from tolcontact.mechanics.groups import Group, contact_groups
from tolcontact.mechanics.measures import measured, record
from tolcontact.mechanics.placement import raw_poses
from tolcontact.mechanics.pose import ENTRIES, Pose, poses_of
from tolcontact.mechanics.quiet import CONSTRUCTION_LOCK, quiet
from tolcontact.mechanics.round_gap import round_gaps
from tolcontact.method import Method
from tolcontact.poses import AT_REST
from tolcontact.readable import Pictured
from tolcontact.variation import Draws

log = logging.getLogger(__name__)
WATCH_DRAWS = 64  # that bound the motion of bodies
PLANES_FACTOR = 3.0  # times the error that a trial allows: allowed penetration of faces on fixed planes


@dataclass(frozen=True, eq=False)
class ContactGroup:
    """A group of coupled parts and its QP (see contact_qp)."""

    group: Group
    qp: ContactQP
    solve: ContactSolver


@dataclass(frozen=True, eq=False, repr=False)
class Program(Pictured):
    """The functions of a model that a simulation evaluates. Poses have 12 entries: R row by row, t [mm].

    draws        the draws of all contributors
    place        deviations (realization, contributor) -> poses (realization, 12 * part)
    observe      poses, deviations -> measured (realization, measure), relative (realization, 12 * pair): X_RM of every pair
    gaps         gaps of each pair at X_RM, which are affine in it; None for round faces
    round_gaps   X_RM, deviations -> gaps (realization, point), distances (realization, point) by pair index
    meetings     by pair index: where its bodies can touch, if fixed planes do not represent its reference face
    trials       by pair index: the trial that decided this; none unless the search is bounded
    groups       the contact QPs
    nominal_measures  values of the measures in the nominal assembly
    accuracies   accuracies of the measures, in their units (see measure_accuracies)
    stations     stations of an assembly that is built in steps, in their order; `place` then places the parts of all stations
    watch        detects bodies that interfere
    tapes        user-defined expressions by measure name
    """

    nominal: Nominal
    draws: Draws
    method: Method
    solver: SolverChoice
    place: NamedFunction
    observe: NamedFunction
    gaps: tuple[GapMap | None, ...]
    round_gaps: dict[int, NamedFunction]
    meetings: dict[int, Meeting]
    trials: dict[int, Trial]
    groups: tuple[ContactGroup, ...]
    nominal_measures: np.ndarray
    accuracies: np.ndarray
    watch: Watch
    tapes: dict[str, Tape]
    stations: tuple[StationProgram, ...] = ()

    def __str__(self) -> str:
        nominal, method = self.nominal, self.method
        rows = [f"program of {nominal.assembly.name}: {self.solver.name}, {method.resolution}, {method.objective}"]
        rows += [
            f"  part {part.name}{f' in station {part.station}' * bool(part.station)}: "
            f"{'joined' if part.carried else f'{len(part.locators)} locators'}{', free' * part.free}"
            for part in nominal.parts
        ]
        rows += [f"  contact {pair.name}: {self.contact_in_words(k)}" for k, pair in enumerate(nominal.pairs)]
        rows += [f"  {self.stored_coordinates}"] * bool(self.stored_coordinates)
        rows += [
            f"  measurement {measure.name}: nominally {value:.6g} {measure.units}"
            for measure, value in zip(nominal.measures, self.nominal_measures, strict=True)
        ]
        return "\n".join(rows)

    @property
    def stored_coordinates(self) -> str:
        """The accuracy of stored coordinates of parts in contact, and what contact allows; empty if it hardly matters."""
        return coordinates_in_words(self.nominal)

    def limits(self, measure: int) -> Limits:
        """Return the limits of a measure, given by index, with its accuracy."""
        nominal, accuracy = float(self.nominal_measures[measure]), float(self.accuracies[measure])
        return Limits(*self.nominal.measures[measure].bounds(nominal), accuracy)

    def contact_in_words(self, k: int) -> str:
        """Return a short description of contact pair k: its points, and whether they are fixed or searched at every pose."""
        words, trial = self.nominal.pairs[k].in_words, self.trials.get(k)
        if trial is None or math.isnan(trial.error):
            return words
        if k in self.meetings:
            return f"{words}; contact is searched at every pose, since fixed points would err by up to {trial.error:.2g} mm"
        return f"{words}; they are fixed, and err by {trial.error:.2g} mm at most"


def compile_program(nominal: Nominal, solver: str, method: Method) -> Program:
    """Build all Functions of a model.

    Raises OptionError for a solver that cannot be used, ModelError for a user-defined measure that fails, or, if the objective
    is seating, for forces that are missing or act on parts that contact cannot move.
    """
    _check_placing(nominal, method)
    _check_springs(nominal, method)
    draws = Draws(nominal)
    with CONSTRUCTION_LOCK:  # user-defined functions run here, too, and may print
        with quiet():
            choice = solver_choice(solver)
        d = ca.SX.sym("deviations", len(nominal.contributors))
        raw = ca.vertcat(*(pose.vector() for pose in raw_poses(nominal, d)))
        entries = ca.SX.sym("poses", ENTRIES * len(nominal.parts))
        poses = poses_of(entries)
        values = measured(nominal, poses, d)
        X_RM = _facing_poses(nominal, poses, d)
        observe = ca.Function(
            "observe",
            [entries, d],
            [ca.vertcat(*values), ca.vertcat(*X_RM)],
            ["poses", "deviations"],
            ["measured", "relative"],
        )
        groups = contact_groups(nominal, weighs_areas=method.is_exact)
        gaps = tuple(None if pair.round else gap_map(gap_matrix(pair), pair.offsets) for pair in nominal.pairs)
        round_functions = {k: _round_gap_function(pair, pair.round, d) for k, pair in enumerate(nominal.pairs) if pair.round}
        if method.minimizes.presses:
            _check_forces(nominal, groups)
        place = NamedFunction.dense(ca.Function("place", [d], [raw], ["deviations"], ["poses"]))
        observed = NamedFunction.dense(observe)
        watch = _watch(nominal, draws, place)
        meetings, trials = _meetings(watch, groups, draws, place, observed, method) if method.is_bounded else ({}, {})
        log.info("compiling %d parts, %d of them coupled by contact", len(nominal.parts), sum(len(g.free) for g in groups))
        return Program(
            nominal=nominal,
            draws=draws,
            method=method,
            solver=choice,
            place=place,
            observe=observed,
            gaps=gaps,
            round_gaps={k: NamedFunction.dense(function) for k, function in round_functions.items()},
            meetings=meetings,
            trials=trials,
            groups=tuple(_contact_group(nominal, group, gaps, method, choice, meetings, trials) for group in groups),
            accuracies=measure_accuracies(nominal, groups, draws, place, observed),
            watch=watch.allowing(_allowed_depths(nominal, meetings, trials)),
            nominal_measures=observe(np.tile(AT_REST, len(nominal.parts)), np.zeros(d.numel()))[0].full().ravel(),
            tapes={
                measure.name: record(value, ca.vertcat(entries, d))
                for measure, value in zip(nominal.measures, values, strict=True)
                if measure.is_expression
            },
            stations=tuple(station_programs(nominal, groups, method)),
        )


def _facing_poses(nominal: Nominal, poses: Sequence[Pose], deviations: ca.SX) -> list[ca.SX]:
    """Return X_RM of each pair as vectors of 12 entries."""
    pairs = [(pair, poses[pair.moving], None if pair.reference is None else poses[pair.reference]) for pair in nominal.pairs]
    return [facing_pose(face_poses(pair, deviations), moving, reference).vector() for pair, moving, reference in pairs]


def _round_gap_function(pair: ContactPoints, points: RoundPoints, deviations: ca.SX) -> ca.Function:
    X_RM = ca.SX.sym("X_RM", ENTRIES)
    results = round_gaps(points, X_RM, face_heights(pair, deviations), ca.SX(len(points), 1), ca.SX(ENTRIES, 0))
    outputs = {"gaps": results.gaps, "distances": results.distances}
    return ca.Function("round_gaps", [X_RM, deviations], [*outputs.values()], ["X_RM", "deviations"], [*outputs])


def _meetings(
    watch: Watch, groups: Sequence[Group], draws: Draws, place: NamedFunction, observe: NamedFunction, method: Method
) -> tuple[dict[int, Meeting], dict[int, Trial]]:
    """Return the meetings of the pairs that need them, and the trials of all pairs of faces."""
    nominal = watch.nominal
    if not nominal.pairs:
        return {}, {}
    deviations = draws(seed=TRIAL_SEED, start=0, stop=TRIALS)
    poses = place(deviations=deviations)["poses"]
    relative = observe(poses=poses, deviations=deviations)["relative"].reshape(len(poses), len(nominal.pairs), ENTRIES)
    is_finite = np.isfinite(relative).all(axis=(1, 2))
    relative, deviations, presses = relative[is_finite], deviations[is_finite], method.minimizes.presses
    pushes = [push(pair, relative[:, k], deviations, presses=presses) for k, pair in enumerate(nominal.pairs)]
    decisions = {}
    for group in groups:
        pushed = sum(pushes[k] for k in group.pairs)
        for k in group.pairs:
            room = pushed if presses else pushed - pushes[k]
            decisions[k] = bounded_pair(watch, k, relative[:, k], deviations, pushed=pushed, room=room)
    meetings = {k: meeting for k, (meeting, _) in decisions.items() if meeting is not None}
    return meetings, {k: trial for k, (_, trial) in decisions.items()}


def _watch(nominal: Nominal, draws: Draws, place: NamedFunction) -> Watch:
    deviations = draws(seed=TRIAL_SEED, start=0, stop=WATCH_DRAWS)
    poses = place(deviations=deviations)["poses"].reshape(len(deviations), len(nominal.parts), ENTRIES)
    return Watch(nominal, {}, poses, deviations)


def _allowed_depths(
    nominal: Nominal, meetings: Mapping[int, Meeting], trials: Mapping[int, Trial]
) -> dict[tuple[int, int], float]:
    """Return the allowed penetration [mm] of bodies of contact pairs, where it exceeds the default.

    Fixed planes err by the error allowed in their trial, at raw poses; other contact tilts parts more. Faces on springs
    penetrate each other, and form is not part of a solid. Parts that are declared to overlap may penetrate to any depth. Bodies
    in the watch have flat planes, but fixed contact points lie on triangles, with coordinates rounded by the file.
    """
    depths = dict[tuple[int, int], float]()
    for k, pair in enumerate(nominal.pairs):
        if pair.reference is not None and pair.moving_face is not None:
            bodies = ordered(pair.moving, pair.reference)
            is_free = pair.is_springy or pair.has_form
            is_fixed = k in trials and k not in meetings and np.isfinite(trials[k].allowed)
            planes = PLANES_FACTOR * trials[k].allowed if is_fixed else 0.0
            rounding = 0.0 if k in meetings else pair.coordinate_error
            depths[bodies] = max(depths.get(bodies, 0.0), np.inf if is_free else planes + rounding)
    return depths | dict.fromkeys(_declared_overlaps(nominal), np.inf)


def _declared_overlaps(nominal: Nominal) -> Iterator[tuple[int, int]]:
    """Yield the pairs of bodies, of one station, that are declared to overlap."""
    for overlap in nominal.assembly.overlaps:
        indices = [index for index, part in enumerate(nominal.parts) if part.part in overlap.parts]
        for left, right in itertools.combinations(indices, 2):
            if nominal.parts[left].station == nominal.parts[right].station:
                yield left, right


def _contact_group(
    nominal: Nominal,
    group: Group,
    gaps: Sequence[GapMap | None],
    method: Method,
    choice: SolverChoice,
    meetings: Mapping[int, Meeting],
    trials: Mapping[int, Trial],
) -> ContactGroup:
    # The contact points of a pair with a meeting change with every pose, so that none always has a row.
    standing = [
        min(max(trials[k].max_points, MIN_SLOTS), SLOTS)
        if k in meetings
        else standing_points(nominal.pairs[k], gaps[k], method)
        for k in group.pairs
    ]
    qp = contact_qp(nominal, group, gaps, method, standing)
    return ContactGroup(group, qp, ContactSolver(qp, choice))


def _check_placing(nominal: Nominal, method: Method) -> None:
    """Raise ModelError for placed parts under forces, if they are located by springs or by too many locators."""
    faults = [
        f'part "{part.name}": its locators are placed by "{part.locators.placing}", and if forces press, they have to be at '
        "most six, without a stiffness; leave placing out, or declare the part fixed=True"
        for index, part in enumerate(nominal.parts)
        if index in part.movers and part.locators.placing != FIRST_ORDER and method.minimizes.presses
        if len(part.locators) > FREEDOMS or part.locators.springy.any()
    ]
    if faults:
        raise ModelError(nominal.assembly.name, faults)


def _check_springs(nominal: Nominal, method: Method) -> None:
    """Raise ModelError for a stiffness without effect, or without forces and repeated steps, which it needs."""
    faults = [
        f'locator "{part.locators.labels[index]}": it has a stiffness, but part "{part.name}" is fixed=True, so forces do not '
        "move it; leave stiffness out, or declare the part fixed=False"
        for part in nominal.parts
        for index in (np.flatnonzero(part.locators.springy)[:1] if not part.free else ())
    ]
    if faults:
        raise ModelError(nominal.assembly.name, faults)
    if method.minimizes.presses and method.is_exact:
        return
    faults = [
        f'{_compliant_name(pair)} has a stiffness, which needs the objective "seating" and the resolution "exact"; '
        f'here they are "{method.objective}" and "{method.resolution}"; choose those, or leave stiffness out'
        for pair in nominal.pairs
        if pair.is_springy
    ]
    if faults:
        raise ModelError(nominal.assembly.name, faults)


def _compliant_name(pair: ContactPoints) -> str:
    if pair.pulls is not None:
        return f'locator "{pair.name}": it'
    return f"{pair.name}: a support" if pair.is_supports else f'contact pair "{pair.name}": it'


def _check_forces(nominal: Nominal, groups: list[Group]) -> None:
    moved = {part for group in groups for part, mobility in zip(group.parts, group.mobilities, strict=True) if mobility.movers}
    faults = [
        f'force "{force.name}" acts on part "{force.at.part.name}", which contact cannot move, but the objective is "seating"; '
        "leave the force out, or declare the part free, with its contacts"
        for force in nominal.assembly.forces
        if nominal.part_index(force.at.part, force.station) not in moved
    ]
    if not nominal.assembly.forces:
        faults = ['objective "seating" needs a force, and none is declared; declare one with assembly.force(...)']
    if faults:
        raise ModelError(nominal.assembly.name, faults)
