"""An elastic part on a rigid one against a contact problem over all freedoms of its mesh, without flexibility or poses.

The mesh and its pads are the package's. The problem, least elastic energy without penetration, is convex: an active set that
meets all its conditions solves it. Rows that pull leave the set, and rows that penetrate enter it.
"""

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

import tolcontact as tc
from studies.tables import Table
from tolcontact.declaration import Point
from tolcontact.elasticity.pads import SurfacePads
from tolcontact.elasticity.tetrahedra import stiffness_of
from tolcontact.mechanics.flexibility import elastic_bodies
from tolcontact.poses import AT_REST
from tolcontact.simulation import simulate_block
from tolcontact.vocabulary import CORRECTED

SCALE = 1e5  # N/mm: of the stiffness, in the linear systems
ROUNDS, OPEN, PULL = 20, 1e-8, 1e-6  # mm and N: limits of rounding


class WholePart:
    """The part with all freedoms of its mesh, linear about the nominal assembly; its rigid motions are displacements, too."""

    def __init__(self, program: tc.Program) -> None:
        self.program, self.nominal = program, program.nominal
        ((declared, self.body),) = elastic_bodies(self.nominal).items()
        self.part = next(part for part in self.nominal.parts if part.part is declared)
        assert isinstance(self.body.pads, SurfacePads) and declared.elasticity is not None
        assert declared.elasticity.E is not None and declared.elasticity.nu is not None
        self.K = stiffness_of(self.body.pads.mesh, declared.elasticity.E, declared.elasticity.nu).tocsc()
        points = [(self.nominal.pairs[pair], point) for pair, point in self.nominal.loads]
        self.N = self.spread([pair.P_m[point] for pair, point in points], [pair.n_r[point] for pair, point in points])
        self.holds = np.array([pair.holds for pair, _ in points])
        forces = self.nominal.assembly.forces
        self.F = self.spread([self.nominal.position(force.at) for force in forces], [force.vector for force in forces]).sum(
            axis=1
        )
        places = [self.nominal.position(measure.of) for measure in self.nominal.measures if isinstance(measure.of, Point)]
        self.measured = self.spread(places, [(0, 0, 1)] * len(places))

    def spread(self, points: list[np.ndarray], directions: list[object]) -> np.ndarray:
        """Return nodal forces (3 node, load) of unit forces."""
        R, t = self.part.placement
        return self.body.spread((np.array(points, dtype=float) - t) @ R, np.array(directions, dtype=float) @ R, None).toarray()

    def gaps(self, deviations: np.ndarray) -> np.ndarray:
        """Return the gaps (realization, load) [mm] of the nominal assembly with deviations."""
        poses = np.tile(AT_REST, (len(deviations), len(self.nominal.parts)))
        relative = self.program.observe(poses=poses, deviations=deviations)["relative"].reshape(len(deviations), -1, 12)
        gaps = np.empty((len(deviations), len(self.nominal.loads)))
        for column, (k, point) in enumerate(self.nominal.loads):
            pair = self.nominal.pairs[k]
            points = np.full((len(deviations), 1), point)
            gaps[:, column] = pair.nominal_gaps(relative[:, k])[:, point] - pair.offsets.heights(deviations, points)[:, 0]
        return gaps

    def solved(self, gaps: np.ndarray, active: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the measured displacements [mm], and the reactions (load,) [N], starting from an active set (load,)."""
        for _ in range(ROUNDS):
            E = self.N[:, np.flatnonzero(active)]
            system = sp.bmat([[self.K / SCALE, E], [E.T, None]]).tocsc()
            right, factors = np.concatenate([self.F / SCALE, -gaps[active]]), splu(system)
            x = factors.solve(right)
            x += factors.solve(right - system @ x)
            reactions, u = np.zeros(len(gaps)), x[: len(self.F)]
            reactions[active] = -x[len(self.F) :] * SCALE
            pulls = active & ~self.holds & (reactions < -PULL)
            penetrates = ~active & (gaps + self.N.T @ u < -OPEN)
            if not (pulls | penetrates).any():
                return self.measured.T @ u, reactions
            active = active & ~pulls | penetrates
        raise AssertionError("the rows that touch are not found")


def whole_part(name: str, program: tc.Program, draws: int) -> list[object]:
    """Return a row on how far the package is from the whole mesh: heights [mm] and forces, of the largest."""
    part, deviations = WholePart(program), program.draws(seed=1, start=0, stop=draws)
    block, touching, errors = simulate_block(program, deviations), list[int](), list[tuple[float, float]]()
    for k, gaps in enumerate(part.gaps(deviations)):
        measured, reactions = part.solved(gaps, part.holds | (block.load[k] > 0))
        forces = np.abs(block.load[k] - reactions).max() / reactions.max()
        errors.append((float(np.abs(block.measured[k, CORRECTED] - measured).max()), float(forces)))
        touching.append(int((reactions[~part.holds] > 0).sum()))
    size = [f"{part.K.shape[0]}", f"{len(part.holds)}", f"{draws}", f"{min(touching)} to {max(touching)}"]
    return [name, *size, *(f"{largest:.1e}" for largest in np.max(errors, axis=0))]


def whole_parts(programs: dict[str, tc.Program], draws: int) -> Table:
    """Return a row for each of some programs by their names."""
    header = ["model", "freedoms", "rows", "draws", "points that touch", "heights differ by, mm", "forces by, of the largest"]
    return [header, *(whole_part(name, program, draws) for name, program in programs.items())]
