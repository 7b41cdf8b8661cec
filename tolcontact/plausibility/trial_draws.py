"""Some draws of a model without contact: how far gaps and measures vary."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float, Int
from tolcontact.compilation import Program
from tolcontact.compilation.trials import TRIAL_SEED, push
from tolcontact.contact import pair_search
from tolcontact.interference import Clash
from tolcontact.simulation import Block, simulate_block

DRAWS = 128
SIGMAS = 3.0  # of a gap or a measure: it varies by less in nearly all realizations


@dataclass(frozen=True, eq=False)
class TrialDraws:
    """Draws of a program, placed without contact.

    deviations   (draw, contributor)
    relative     (draw, pair, 12): X_RM of every pair
    measured     (draw, measure); a function of poses may return NaN
    poses        (draw, part, 12)
    """

    program: Program
    deviations: Float[Array, "n contributor"]
    relative: Float[Array, "n pair 12"]
    measured: Float[Array, "n measure"]
    poses: Float[Array, "n part 12"]

    @classmethod
    def of(cls, program: Program) -> "TrialDraws":
        """Return the draws of a program, without those that have no finite pose."""
        deviations = program.draws(seed=TRIAL_SEED, start=0, stop=DRAWS)
        placed = program.place(deviations=deviations)["poses"]
        measured, relative = program.observed(placed, deviations)
        finite = np.isfinite(relative).all(axis=(1, 2))
        poses = placed.reshape(len(deviations), len(program.nominal.parts), pose.ENTRIES)
        return cls(program, deviations[finite], relative[finite], measured[finite], poses[finite])

    def some(self, rows: Int[Array, " k"]) -> "TrialDraws":
        """Return some of these draws, rows (k,)."""
        return TrialDraws(self.program, self.deviations[rows], self.relative[rows], self.measured[rows], self.poses[rows])

    def nominal_gaps(self, k: int) -> Float[Array, " point"]:
        """Return the gaps (point,) [mm] of pair k in the nominal assembly."""
        return self._gaps(k, pose.AT_REST[None], np.zeros((1, self.deviations.shape[1])))[0]

    def gaps(self, k: int, points: np.ndarray) -> Float[Array, "n point"]:
        """Return the gaps (draw, point) [mm] of some points of pair k."""
        return self._gaps(k, self.relative[:, k], self.deviations, points)

    def _gaps(self, k: int, X_RM: np.ndarray, deviations: np.ndarray, points: np.ndarray | None = None) -> np.ndarray:
        pair = self.program.nominal.pairs[k]
        if not pair.samples_faces:
            return pair_search(self.program, k).gaps(X_RM, deviations, points)
        points = np.arange(len(pair.P_m)) if points is None else points
        gaps = pair.nominal_gaps(X_RM, points) - pair.heights(deviations)[:, None]
        return gaps - pair.form_heights(deviations, points)

    @cached_property
    def clashes(self) -> list[Clash]:
        """Pairs of bodies that interfere in some draws."""
        return list(self.program.watch.clashes(self.poses, self.deviations))

    @cached_property
    def resolved(self) -> Block:
        """The same draws with contact."""
        return simulate_block(self.program, self.deviations)

    @cached_property
    def nominally_resolved(self) -> Block:
        """The nominal assembly with contact."""
        return simulate_block(self.program, np.zeros((1, self.deviations.shape[1])))

    @cached_property
    def pushes(self) -> list[float]:
        """The displacement [mm] of parts that contact of each pair, and forces, may cause."""
        presses, pairs = self.program.method.minimizes.presses, self.program.nominal.pairs
        return [push(pair, self.relative[:, k], self.deviations, presses=presses) for k, pair in enumerate(pairs)]

    def pushed_by_others(self, k: int) -> float:
        """Return the displacement [mm] of its parts that the other contact of the group of pair k may cause."""
        groups = [group.group.pairs for group in self.program.groups if k in group.group.pairs]
        return sum(self.pushes[other] for pairs in groups for other in pairs if other != k)


def spread(values: Float[Array, "n ..."]) -> Float[Array, "..."]:
    """Return the standard deviation of draws (draw, ...) from the quantiles at one sigma, which are insensitive to outliers."""
    low, high = np.quantile(values, (0.1587, 0.8413), axis=0)
    return np.asarray((high - low) / 2)
