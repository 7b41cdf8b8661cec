"""A block of realizations: its simulation, from deviations to corrected poses and measures, and its results as arrays."""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields

import numpy as np

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation import Program
from tolcontact.compilation.station_program import StationProgram
from tolcontact.contact import ContactResolver, Resolved
from tolcontact.contact.record import Record, join_groups, untouched_numbers
from tolcontact.contact.state import Outcome
from tolcontact.mechanics import ENTRIES
from tolcontact.readable import Readable
from tolcontact.simulation.bodies import watched_bodies
from tolcontact.simulation.locator_offsets import locator_offsets
from tolcontact.vocabulary import CORRECTED, RAW, Status


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Block(Record, Readable):
    """Realizations `start` to `start + n`; the first dimension of every array is the realization.

    deviations    (n, contributor), in mm or the units of the contributor
    poses         (n, state, part, 12): R row by row, t [mm]
    measured      (n, state, measure)
    gap_min       (n, state, pair) [mm]: smallest true gap (5) of all contact points at the archived poses
    active        (n, pair): number of active contact points in the raw state
    carrying      (n, pair): number of contact points under load: with more than 1e-4 of the largest reaction
    reaction      (n, pair): sum of the reactions of these points, in the units of the objective
    weld_gap      (n, weld row) [mm]: gaps that welds keep, from the station that joined their parts
    load          (n, load) [N]: reactions at the contact points between elastic parts, see Nominal.loads
    clashes       (n,): number of pairs of parts without declared contact that lie in each other in the corrected state; -1 if
                  they were not tested
    clash_depth   (n,) [mm]: penetration of the deepest of these pairs, NaN if it is not measured; clash_part, clash_other (n,)
                  are the indices of its parts in the assembly, -1 if there is none. Without such a pair they name parts with
                  declared contact that make the answer doubtful
    locator_offset  (n, part) [mm]: how far contact moved a part off its rigid two-sided locators
    status        (n,), Status: with stations, the status of the worst station
    station_status  (n, station), Status

    With stations, the parts, pairs and measures of all stations are concatenated.
    The diagnostics of the record (kkt_residual, iterations, starts, second_answers, searched) are 0 if there is no contact.
    """

    start: int
    poses: Float[Array, "n state part 12"]
    deviations: Float[Array, "n contributor"] = field(metadata={"variable": terms.DEVIATION})
    measured: Float[Array, "n state measure"] = field(metadata={"variable": terms.MEASURED})
    gap_min: Float[Array, "n state pair"] = field(metadata={"variable": terms.GAP_MIN})
    active: Int[Array, "n pair"] = field(metadata={"variable": terms.ACTIVE})
    carrying: Int[Array, "n pair"] = field(metadata={"variable": terms.CARRYING})
    reaction: Float[Array, "n pair"] = field(metadata={"variable": terms.REACTION})
    weld_gap: Float[Array, "n weld_row"] = field(metadata={"variable": terms.WELD_GAP})
    load: Float[Array, "n load"] = field(metadata={"variable": terms.LOAD})
    clashes: Int[Array, " n"] = field(metadata={"variable": terms.CLASHES})
    clash_depth: Float[Array, " n"] = field(metadata={"variable": terms.CLASH_DEPTH})
    clash_part: Int[Array, " n"] = field(metadata={"variable": terms.CLASH_PART})
    clash_other: Int[Array, " n"] = field(metadata={"variable": terms.CLASH_OTHER})
    locator_offset: Float[Array, "n part"] = field(metadata={"variable": terms.LOCATOR_OFFSET})
    status: Int[Array, " n"] = field(metadata={"variable": terms.STATUS})
    station_status: Int[Array, "n station"]

    def __len__(self) -> int:
        return len(self.status)

    def __str__(self) -> str:
        counts = np.bincount(self.status, minlength=len(terms.Status))
        text = ", ".join(f"{counts[status]} {status.name.lower()}" for status in terms.Status if counts[status])
        return f"realizations {self.start} to {self.start + len(self) - 1}: {text}"

    def values(self) -> dict[terms.ArchiveVariable, np.ndarray]:
        """Return the values of all variables of realizations, (n, ...)."""
        values = {entry.metadata["variable"]: getattr(self, entry.name) for entry in fields(self) if entry.metadata}
        return values | {terms.ROTATION: pose.rotation(self.poses), terms.TRANSLATION: pose.translation(self.poses)}

    @classmethod
    def untouched(
        cls,
        program: Program,
        start: int,
        deviations: Float[Array, "n contributor"],
        raw: Float[Array, "n part 12"],
        measured: Float[Array, "n measure"],
    ) -> "Block":
        """Return realizations at their raw poses (n, part, 12), with measures (n, measure), that contact does not change."""
        nominal, count, states, status = program.nominal, len(raw), len(terms.STATES), terms.Status.UNTOUCHED
        pairs = count, len(nominal.pairs)
        return cls(
            **untouched_numbers(count),
            start=start,
            deviations=deviations,
            poses=np.stack([raw] * states, axis=1),
            measured=np.stack([measured] * states, axis=1),
            gap_min=np.empty((count, states, len(nominal.pairs))),
            active=np.zeros(pairs, dtype=int),
            carrying=np.zeros(pairs, dtype=int),
            reaction=np.zeros(pairs),
            load=np.zeros((count, len(nominal.loads))),
            weld_gap=np.zeros((count, nominal.input_count - deviations.shape[1])),
            clash_depth=np.zeros(count),
            **{name: np.full(count, -1) for name in ("clashes", "clash_part", "clash_other")},
            locator_offset=np.zeros(raw.shape[:2]),
            status=np.full(count, status, dtype=np.int8),
            station_status=np.full((count, len(program.stations)), status, dtype=np.int8),
        )

    @classmethod
    def joined(cls, blocks: Iterable["Block"]) -> "Block":
        """Return consecutive blocks as one."""
        parts = list(blocks)
        names = [entry.name for entry in fields(cls) if entry.name != "start"]
        return cls(start=parts[0].start, **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def outcomes(block: Block) -> tuple[Float[Array, "n state measure"], Int[Array, " n"]]:
    """Return copies of measures (n, state, measure) and statuses (n,), so that the block itself can be freed."""
    return defined_measures(block), block.status.copy()


def defined_measures(block: Block) -> Float[Array, "n state measure"]:
    """Return a copy of the measures (n, state, measure) of a block; an infinite value is not a number."""
    return np.where(np.isfinite(block.measured), block.measured, np.nan)


def simulate_block(
    program: Program,
    deviations: Float[Array, "n contributor"],
    *,
    start: int = 0,
    resolvers: list[ContactResolver] | None = None,
) -> Block:
    """Return raw and corrected states for deviations (realization, contributor), in mm or the units of the contributor."""
    if resolvers is None:
        resolvers = [ContactResolver(program, group).twin() for group in program.groups]
    placed = program.place(deviations=deviations)["poses"]
    raw = placed.reshape(len(deviations), len(program.nominal.parts), ENTRIES)
    measured, relative = program.observed(raw, deviations)
    nominal, block = program.nominal, Block.untouched(program, start, deviations, raw, measured)
    stages = program.stations or (None,)
    outcomes_by_stage = np.zeros((len(block), len(stages)), dtype=np.int8)
    # NaN gaps count as no contact, so realizations with NaN poses are marked as unsolved below.
    is_unknown = ~np.isfinite(raw).all(axis=(1, 2))
    raw_relative = relative.copy() if program.stations else relative
    raw_inputs = np.concatenate([deviations, block.weld_gap], axis=1) if nominal.welds else deviations
    inputs = raw_inputs.copy() if nominal.welds else deviations
    for position, station in enumerate(stages):
        worst = outcomes_by_stage[:, position]
        changed = np.flatnonzero(outcomes_by_stage.any(axis=1))
        is_placed_again = station is not None and _hand_over(
            station, changed, raw, relative, block.poses[:, CORRECTED], deviations
        )
        for resolver in resolvers if station is None else [resolvers[index] for index in station.groups]:
            resolved = resolver.resolve(raw, relative, inputs)
            _put(block, resolver, resolved)
            if is_placed_again:
                # Contact was resolved from handed-over poses. Welds keep no gaps before contact.
                gaps, active = resolver.raw_contact(raw_relative[changed], raw_inputs[changed])
                block.gap_min[changed[:, None], RAW, resolver.pairs] = gaps
                block.active[changed[:, None], resolver.pairs] = active
            worst[resolved.touched] = np.maximum(worst[resolved.touched], resolved.state.outcome)
        for weld in nominal.welds:
            if program.bending is not None and station is not None and weld.station == station.name:
                inputs[:, weld.columns] = program.bending.weld_gaps(weld, block.poses[:, CORRECTED], block.load)
    if program.method.is_bounded:
        _watch(program, block, resolvers, outcomes_by_stage)
    block.weld_gap[:] = inputs[:, deviations.shape[1] :]
    is_unknown |= ~np.isfinite(raw).all(axis=(1, 2))
    outcomes_by_stage[is_unknown], block.kkt_residual[is_unknown] = Outcome.UNSOLVED, np.inf
    worst = outcomes_by_stage.max(axis=1)
    touched = worst > Outcome.UNTOUCHED
    block.measured[touched, CORRECTED], _ = program.observed(block.poses[touched, CORRECTED], deviations[touched])
    if program.observe_bent is not None:
        poses = block.poses[touched, CORRECTED].reshape(int(touched.sum()), -1)
        bent = program.observe_bent(poses=poses, deviations=deviations[touched], loads=block.load[touched])
        block.measured[touched, CORRECTED] = bent["measured"]
    block.locator_offset[touched] = locator_offsets(program.nominal, block.poses[touched])
    # Only repeated steps can show that no pose is free of penetration.
    conflict = Status.NOT_ASSEMBLABLE if program.method.is_exact else Status.NOT_CONVERGED
    by_outcome = [Status.UNTOUCHED, Status.RESOLVED, conflict, Status.DOUBTFUL, Status.NOT_CONVERGED]
    statuses = np.array(by_outcome, dtype=np.int8)
    block.status[:], block.station_status[:] = statuses[worst], statuses[outcomes_by_stage[:, : len(program.stations)]]
    return block


def _watch(program: Program, block: Block, resolvers: list[ContactResolver], outcomes_by_stage: Int[Array, "n stage"]) -> None:
    """Write the bodies that interfere into a block, and withdraw the certificates that they refute."""
    worst = outcomes_by_stage.max(axis=1)
    bodies = watched_bodies(
        program,
        block.poses[:, CORRECTED],
        block.deviations,
        start=block.start,
        tested=[pair for resolver in resolvers for pair in resolver.watched],
        is_doubtful=worst == Outcome.DOUBTFUL,
        is_certified=worst <= Outcome.RESOLVED,
    )
    block.clashes[:], block.clash_depth[:] = bodies.clashes, bodies.depth
    block.clash_part[:], block.clash_other[:] = bodies.part, bodies.other
    for index, rows in bodies.withdrawn:
        of_stage = outcomes_by_stage[:, index]
        of_stage[rows] = np.where(of_stage[rows] <= Outcome.RESOLVED, Outcome.DOUBTFUL, of_stage[rows])


def _hand_over(
    station: StationProgram,
    rows: Int[Array, " row"],
    initial: Float[Array, "realization part 12"],
    relative: Float[Array, "realization pair 12"],
    corrected: Float[Array, "realization part 12"],
    deviations: Float[Array, "realization contributor"],
) -> bool:
    """Place the joints of a station again if contact in earlier stations has changed them, and return whether it did.

    rows               realizations that contact in earlier stations has changed
    initial, relative  poses, and X_RM of the pairs, before contact is resolved; values of this station are replaced
    corrected          corrected poses of earlier stations, and raw poses of this station, which are replaced, too
    """
    if station.place is None or not rows.size:
        return False
    placed = station.place(poses=corrected[rows[:, None], station.sources], deviations=deviations[rows])
    poses = placed["placed"].reshape(len(rows), len(station.parts), ENTRIES)
    corrected[rows[:, None], station.parts] = initial[rows[:, None], station.parts] = poses
    relative[rows[:, None], station.pairs] = placed["relative"].reshape(len(rows), len(station.pairs), ENTRIES)
    return True


def _put(block: Block, resolver: ContactResolver, resolved: Resolved) -> None:
    """Write the results of a group into the block."""
    touched, state, pairs = resolved.touched, resolved.state, resolver.pairs
    block.poses[touched[:, None], CORRECTED, resolver.parts] = state.poses
    block.gap_min[:, :, pairs], block.active[:, pairs] = resolved.gap_min, resolved.active
    block.carrying[np.ix_(touched, pairs)] = resolved.carrying(resolver.spans)
    block.reaction[np.ix_(touched, pairs)] = resolved.reactions(resolver.spans, resolver.contact_points)
    join_groups(block, touched, state)
    if resolver.flexibility is not None:
        block.load[touched[:, None], resolver.flexibility.loads] = state.multipliers[:, resolver.flexibility.load_rows]
