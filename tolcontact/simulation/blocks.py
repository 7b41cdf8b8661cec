"""The simulation of one block of realizations: from deviations to corrected poses and measures."""

import enum

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation import Program
from tolcontact.contact import ContactResolver, Resolved
from tolcontact.contact.record import join_groups
from tolcontact.mechanics import ENTRIES
from tolcontact.simulation.block import Block
from tolcontact.vocabulary import CORRECTED, Status


class Outcome(enum.IntEnum):
    """The outcome of a realization in one group, the worse the higher: the worst of all groups decides its status."""

    UNTOUCHED = 0
    RESOLVED = 1
    IN_CONFLICT = 2
    DOUBTFUL = 3
    UNSOLVED = 4


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
    measured, relative = _observe(program, raw, deviations)
    block = Block.untouched(start, deviations, raw, measured, len(program.nominal.pairs))
    worst = np.zeros(len(block), dtype=np.int8)
    for resolver in resolvers:
        resolved = resolver.resolve(raw, relative, deviations)
        _put(block, resolver, resolved)
        worst[resolved.touched] = np.maximum(worst[resolved.touched], _outcome(resolved))
    unknown = ~np.isfinite(raw).all(axis=(1, 2))  # gaps that are not numbers touch nothing
    worst[unknown], block.kkt_residual[unknown] = Outcome.UNSOLVED, np.inf
    touched = worst > Outcome.UNTOUCHED
    block.measured[touched, CORRECTED], _ = _observe(program, block.poses[touched, CORRECTED], deviations[touched])
    block.status[:] = _statuses(program.method.is_exact)[worst]
    return block


def _put(block: Block, resolver: ContactResolver, resolved: Resolved) -> None:
    """Write the results of a group into the block."""
    touched, state, pairs = resolved.touched, resolved.state, resolver.pairs
    block.poses[touched[:, None], CORRECTED, resolver.parts] = state.poses
    block.gap_min[:, :, pairs], block.active[:, pairs] = resolved.gap_min, resolved.active
    block.carrying[np.ix_(touched, pairs)] = resolved.carrying(resolver.spans)
    block.reaction[np.ix_(touched, pairs)] = resolved.reactions(resolver.spans)
    join_groups(block, touched, state)


def _outcome(resolved: Resolved) -> Int[Array, " n"]:
    """Return the Outcome of each touched realization (n,)."""
    state = resolved.state
    answered = np.where(state.doubtful, Outcome.DOUBTFUL, np.where(state.in_conflict, Outcome.IN_CONFLICT, Outcome.RESOLVED))
    return np.where(state.solved, answered, Outcome.UNSOLVED)


def _statuses(is_exact: bool) -> np.ndarray:
    """Return the Status for each Outcome. Only repeated steps can tell that no pose is free of penetration."""
    conflict = Status.NOT_ASSEMBLABLE if is_exact else Status.NOT_CONVERGED
    return np.array([Status.UNTOUCHED, Status.RESOLVED, conflict, Status.DOUBTFUL, Status.NOT_CONVERGED], dtype=np.int8)


def _observe(
    program: Program, poses: Float[Array, "n part 12"], deviations: Float[Array, "n contributor"]
) -> tuple[Float[Array, "n measure"], Float[Array, "n pair 12"]]:
    """Return measures (realization, measure) and X_RM (realization, pair, 12) at poses (realization, part, 12)."""
    results = program.observe(poses=poses, deviations=deviations)
    return results["measured"], results["relative"].reshape(len(poses), len(program.nominal.pairs), ENTRIES)
