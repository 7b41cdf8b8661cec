"""What a block of realizations gives, as plain arrays."""

from collections.abc import Iterable
from dataclasses import dataclass, fields

import numpy as np

from tolcontact.arrays import Array, Float, Int
from tolcontact.readable import Readable
from tolcontact.vocabulary import STATES, Status


@dataclass(frozen=True, eq=False, repr=False)
class Block(Readable):
    """Realizations `start` to `start + n`; the first dimension of every array is the realization.

    deviations    (n, contributor), in mm or the units of the contributor
    poses         (n, state, part, 12): R row by row, t [mm]
    measured      (n, state, measure)
    gap_min       (n, state, pair) [mm]: least true gap (5) of all contact points at the archived poses
    active        (n, pair): number of active contact points in the raw state
    carrying      (n, pair): number of contact points under load: with more than 1e-4 of the largest reaction
    reaction      (n, pair): sum of their reactions, in the units of the objective
    status        (n,), Status
    kkt_residual  (n,) [mm], 0 if untouched
    iterations    (n,): linear steps taken, 0 if untouched
    starts        (n,): places the steps were started from, 0 if untouched
    second_answers (n,): QPs that another solver had to answer
    searched      (n,): 1 if contact points were projected again at the corrected pose
    """

    start: int
    deviations: Float[Array, "n contributor"]
    poses: Float[Array, "n state part 12"]
    measured: Float[Array, "n state measure"]
    gap_min: Float[Array, "n state pair"]
    active: Int[Array, "n pair"]
    carrying: Int[Array, "n pair"]
    reaction: Float[Array, "n pair"]
    status: Int[Array, " n"]
    kkt_residual: Float[Array, " n"]
    iterations: Int[Array, " n"]
    starts: Int[Array, " n"]
    second_answers: Int[Array, " n"]
    searched: Int[Array, " n"]

    def __len__(self) -> int:
        return len(self.status)

    def __str__(self) -> str:
        counts = np.bincount(self.status, minlength=len(Status))
        found = ", ".join(f"{counts[status]} {status.name.lower()}" for status in Status if counts[status])
        return f"realizations {self.start} to {self.start + len(self) - 1}: {found}"

    @classmethod
    def untouched(
        cls,
        start: int,
        deviations: Float[Array, "n contributor"],
        raw: Float[Array, "n part 12"],
        measured: Float[Array, "n measure"],
        pairs: int,
    ) -> "Block":
        """Realizations at their raw poses (n, part, 12), with measures (n, measure), that contact leaves as they are."""
        count, states = len(raw), len(STATES)
        return cls(
            start=start,
            deviations=deviations,
            poses=np.stack([raw] * states, axis=1),
            measured=np.stack([measured] * states, axis=1),
            gap_min=np.empty((count, states, pairs)),
            active=np.zeros((count, pairs), dtype=int),
            carrying=np.zeros((count, pairs), dtype=int),
            reaction=np.zeros((count, pairs)),
            status=np.full(count, Status.UNTOUCHED, dtype=np.int8),
            kkt_residual=np.zeros(count),
            iterations=np.zeros(count, dtype=int),
            starts=np.zeros(count, dtype=int),
            second_answers=np.zeros(count, dtype=int),
            searched=np.zeros(count, dtype=np.int8),
        )

    @classmethod
    def joined(cls, blocks: Iterable["Block"]) -> "Block":
        """Blocks that follow each other, as one."""
        every = list(blocks)
        names = [field.name for field in fields(cls) if field.name != "start"]
        return cls(every[0].start, **{name: np.concatenate([getattr(block, name) for block in every]) for name in names})


def outcomes(block: Block) -> tuple[Float[Array, "n state measure"], Int[Array, " n"]]:
    """Measures (n, state, measure) and statuses (n,) of a block, which may go then."""
    return block.measured.copy(), block.status.copy()
