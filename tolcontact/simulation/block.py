"""A block of simulated realizations, as plain arrays."""

from collections.abc import Iterable
from dataclasses import dataclass, field, fields

import numpy as np

from tolcontact import poses as pose
from tolcontact import vocabulary as terms
from tolcontact.arrays import Array, Float, Int
from tolcontact.contact.record import Record, untouched_numbers
from tolcontact.readable import Readable


@dataclass(frozen=True, eq=False, kw_only=True, repr=False)
class Block(Record, Readable):
    """Realizations `start` to `start + n`; the first dimension of every array is the realization.

    deviations    (n, contributor), in mm or the units of the contributor
    poses         (n, state, part, 12): R row by row, t [mm]
    measured      (n, state, measure)
    gap_min       (n, state, pair) [mm]: least true gap (5) of all contact points at the archived poses
    active        (n, pair): number of active contact points in the raw state
    carrying      (n, pair): number of contact points under load: with more than 1e-4 of the largest reaction
    reaction      (n, pair): sum of their reactions, in the units of the objective
    status        (n,), Status

    The numbers of the record (kkt_residual, iterations, starts, second_answers, searched) are 0 if contact touches nothing.
    """

    start: int
    poses: Float[Array, "n state part 12"]
    deviations: Float[Array, "n contributor"] = field(metadata={"variable": terms.DEVIATION})
    measured: Float[Array, "n state measure"] = field(metadata={"variable": terms.MEASURED})
    gap_min: Float[Array, "n state pair"] = field(metadata={"variable": terms.GAP_MIN})
    active: Int[Array, "n pair"] = field(metadata={"variable": terms.ACTIVE})
    carrying: Int[Array, "n pair"] = field(metadata={"variable": terms.CARRYING})
    reaction: Float[Array, "n pair"] = field(metadata={"variable": terms.REACTION})
    status: Int[Array, " n"] = field(metadata={"variable": terms.STATUS})

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
        start: int,
        deviations: Float[Array, "n contributor"],
        raw: Float[Array, "n part 12"],
        measured: Float[Array, "n measure"],
        pairs: int,
    ) -> "Block":
        """Return realizations at their raw poses (n, part, 12), with measures (n, measure), that contact does not change."""
        count, states = len(raw), len(terms.STATES)
        return cls(
            **untouched_numbers(count),
            start=start,
            deviations=deviations,
            poses=np.stack([raw] * states, axis=1),
            measured=np.stack([measured] * states, axis=1),
            gap_min=np.empty((count, states, pairs)),
            active=np.zeros((count, pairs), dtype=int),
            carrying=np.zeros((count, pairs), dtype=int),
            reaction=np.zeros((count, pairs)),
            status=np.full(count, terms.Status.UNTOUCHED, dtype=np.int8),
        )

    @classmethod
    def joined(cls, blocks: Iterable["Block"]) -> "Block":
        """Return blocks that follow each other as one."""
        parts = list(blocks)
        names = [entry.name for entry in fields(cls) if entry.name != "start"]
        return cls(start=parts[0].start, **{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def outcomes(block: Block) -> tuple[Float[Array, "n state measure"], Int[Array, " n"]]:
    """Return copies of measures (n, state, measure) and statuses (n,), so that the block itself can be freed."""
    return block.measured.copy(), block.status.copy()
