"""The compiled model: built once, and evaluated by name for blocks of realizations."""

import logging
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.compilation.contact_qp import ContactQP, Standing, contact_qp, row_count
from tolcontact.compilation.contact_solver import ContactSolver
from tolcontact.compilation.functions import NamedFunction
from tolcontact.compilation.method_checks import check_forces, check_method
from tolcontact.compilation.qp_terms import standing_points
from tolcontact.compilation.solver import SolverChoice
from tolcontact.compilation.solvers import solver_choice
from tolcontact.compilation.station_program import StationProgram, station_programs
from tolcontact.compilation.trials import TRIAL_SEED, Trial, allowed_depths, bounded_pairs, measure_accuracies
from tolcontact.declaration.measure import Tape
from tolcontact.discretization import Nominal, coordinates_in_words
from tolcontact.geometry.meeting import Meeting
from tolcontact.interference import Watch
from tolcontact.limits import Limits
from tolcontact.mechanics.flexibility import (
    Bending,
    PartFlexibility,
    elastic_bodies,
    group_flexibility,
    part_flexibilities,
    with_weights,
)
from tolcontact.mechanics.group_equations import face_poses, facing_pose
from tolcontact.mechanics.groups import Group, contact_groups
from tolcontact.mechanics.measures import measured, record
from tolcontact.mechanics.pair_gaps import pair_gaps
from tolcontact.mechanics.placement import raw_poses
from tolcontact.mechanics.pose import ENTRIES, poses_of
from tolcontact.mechanics.quiet import CONSTRUCTION_LOCK, quiet
from tolcontact.method import Method
from tolcontact.poses import AT_REST
from tolcontact.readable import Pictured
from tolcontact.variation import Draws

log = logging.getLogger(__name__)
WATCH_DRAWS = 64  # that bound the motion of bodies


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
    gaps         gaps of each pair at X_RM: a GapMap, or of points that follow from every pose the function
                 X_RM, deviations -> gaps (realization, point), distances (realization, point)
    meetings     by pair index: where its bodies can touch, if fixed planes do not represent its reference face
    trials       by pair index: the trial that decided this; none unless the search is bounded
    groups       the contact QPs
    bending      the elastic displacements of measured points and welds; None without elastic parts
    observe_bent  poses, deviations, loads (realization, load) [N]: reactions between elastic parts -> measured
                 (realization, measure) of bent parts; None without elastic parts
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
    gaps: tuple[Any, ...]
    meetings: dict[int, Meeting]
    trials: dict[int, Trial]
    groups: tuple[ContactGroup, ...]
    bending: Bending | None
    observe_bent: NamedFunction | None
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
        rows += [f"  {line}" for line in self.elastic_parts_in_words]
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

    @property
    def elastic_parts_in_words(self) -> list[str]:
        """A line for each elastic part, in each of its stations: its size, and how far its constant forces bend it."""
        lines, loads = [], np.zeros(len(self.nominal.loads))
        for index, bent in self.bending.parts.items() if self.bending else ():
            part = self.nominal.parts[index]
            mass = f"mass {bent.mass:.4g} kg" if np.isfinite(bent.mass) else "mass unknown"
            lines.append(
                f"elastic part {part.name}{f' in station {part.station}' * bool(part.station)}: {bent.nodes} nodes, "
                f"{3 * bent.nodes} freedoms, {len(bent.loads)} reactions, {mass}, bent by "
                f"{bent.largest_displacement(loads):.3g} mm by its constant forces as a free body"
            )
        return lines

    def observed(
        self, poses: Float[Array, "n ..."], deviations: Float[Array, "n contributor"]
    ) -> tuple[Float[Array, "n measure"], Float[Array, "n pair 12"]]:
        """Return the measures, and X_RM of every pair, at some poses."""
        results = self.observe(poses=poses, deviations=deviations)
        return results["measured"], results["relative"].reshape(len(poses), len(self.nominal.pairs), ENTRIES)

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
    check_method(nominal, method)
    draws = Draws(nominal)
    with CONSTRUCTION_LOCK:  # user-defined functions run here, too, and may print
        with quiet():
            choice = solver_choice(solver)
        d = ca.SX.sym("deviations", len(nominal.contributors))
        entries = ca.SX.sym("poses", ENTRIES * len(nominal.parts))
        values = measured(nominal, poses_of(entries), d)
        place, observe = _place(nominal, d), _observe(nominal, entries, d, values)
        bodies = elastic_bodies(nominal)
        groups = [with_weights(group, nominal, bodies) for group in contact_groups(nominal, method)]
        if method.minimizes.presses:
            check_forces(nominal, groups)
        watch = _watch(nominal, draws, place)
        meetings, trials = bounded_pairs(watch, groups, draws, place, observe, method)
        gaps = [pair_gaps(pair).compiled(nominal.input_count) for pair in nominal.pairs]
        standing = [standing_points(pair, gaps[k], method, is_searched=k in meetings) for k, pair in enumerate(nominal.pairs)]
        log.info("compiling %d parts, %d of them coupled by contact", len(nominal.parts), sum(len(g.free) for g in groups))
        elastic = part_flexibilities(nominal, bodies)
        bending = Bending(nominal, elastic) if elastic else None
        nowhere, undeviated = np.tile(AT_REST, (1, len(nominal.parts))), np.zeros((1, len(nominal.contributors)))
        return Program(
            nominal=nominal,
            draws=draws,
            method=method,
            solver=choice,
            place=place,
            observe=observe,
            gaps=tuple(NamedFunction.dense(of_pair) if isinstance(of_pair, ca.Function) else of_pair for of_pair in gaps),
            meetings=meetings,
            trials=trials,
            groups=tuple(
                compiled_group(nominal, group, method, [standing[k] for k in group.pairs], elastic, choice) for group in groups
            ),
            bending=bending,
            observe_bent=bent_measures(nominal, bending) if bending else None,
            accuracies=measure_accuracies(nominal, groups, draws, place, observe),
            watch=watch.allowing(allowed_depths(nominal, meetings, trials)),
            nominal_measures=observe(poses=nowhere, deviations=undeviated)["measured"][0],
            tapes={
                measure.name: record(value, ca.vertcat(entries, d))
                for measure, value in zip(nominal.measures, values, strict=True)
                if measure.is_expression
            },
            stations=tuple(station_programs(nominal, groups, method)),
        )


def _place(nominal: Nominal, deviations: ca.SX) -> NamedFunction:
    """Return the function that places all parts without contact, see Program."""
    raw = ca.vertcat(*(pose.vector() for pose in raw_poses(nominal, deviations)))
    return NamedFunction.dense(ca.Function("place", [deviations], [raw], ["deviations"], ["poses"]))


def _observe(nominal: Nominal, entries: ca.SX, deviations: ca.SX, values: Sequence[ca.SX]) -> NamedFunction:
    """Return the function of the measures, with these `values`, and of X_RM of each pair, see Program."""
    at = poses_of(entries).__getitem__
    relative = (facing_pose(pair, face_poses(pair, deviations), at) for pair in nominal.pairs)
    results = [ca.vertcat(*values), ca.vertcat(*(X_RM.vector() for X_RM in relative))]
    return NamedFunction.dense(
        ca.Function("observe", [entries, deviations], results, ["poses", "deviations"], ["measured", "relative"])
    )


def bent_measures(nominal: Nominal, bending: Bending) -> NamedFunction:
    """Return the function of the measures of bent parts, see Program."""
    entries, deviations = ca.SX.sym("poses", ENTRIES * len(nominal.parts)), ca.SX.sym("deviations", len(nominal.contributors))
    values = ca.vertcat(*measured(nominal, poses_of(entries), deviations, bending))
    inputs = {"poses": entries, "deviations": deviations, "loads": bending.loads}
    return NamedFunction.dense(ca.Function("observe_bent", [*inputs.values()], [values], [*inputs], ["measured"]))


def _watch(nominal: Nominal, draws: Draws, place: NamedFunction) -> Watch:
    deviations = draws(seed=TRIAL_SEED, start=0, stop=WATCH_DRAWS)
    poses = place(deviations=deviations)["poses"].reshape(len(deviations), len(nominal.parts), ENTRIES)
    return Watch(nominal, {}, poses, deviations)


def compiled_group(
    nominal: Nominal, group: Group, method: Method, standing: Standing, parts: Sequence[PartFlexibility], solver: SolverChoice
) -> ContactGroup:
    """Compile a group, with the flexibility of its elastic parts."""
    flexibility = group_flexibility(nominal, group, list(map(row_count, standing)), parts)
    qp = contact_qp(nominal, group, method, standing, flexibility=flexibility)
    return ContactGroup(group, qp, ContactSolver(qp, solver))
