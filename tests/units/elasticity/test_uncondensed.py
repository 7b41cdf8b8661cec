"""A plate on a seat with form, against a contact problem over all freedoms of its mesh."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from studies.elastic.measure import cover
from tests.helpers import compiled, nightly
from tolcontact.elasticity import MeshSource, elastic_body
from tolcontact.elasticity.tetrahedra import stiffness_of
from tolcontact.poses import AT_REST
from tolcontact.simulation import simulate_block
from tolcontact.vocabulary import CORRECTED, Status

pytest.importorskip("ngsolve")
MATERIAL = 70e3, 0.33
SCALE = 1e5  # N/mm: of the stiffness, in the linear systems


class WholePlate:
    """The plate with all freedoms of its mesh, linear about the nominal assembly; its rigid motions are displacements, too."""

    def __init__(self, program):
        self.program, self.nominal = program, program.nominal
        self.part = next(part for part in self.nominal.parts if part.name == "cover")
        vertices, faces = (
            np.ascontiguousarray(self.part.mesh.vertices),
            np.ascontiguousarray(self.part.mesh.faces, dtype=np.int64),
        )
        self.body = elastic_body(MeshSource(vertices, faces, *MATERIAL))
        self.K = stiffness_of(self.body.pads.mesh, *MATERIAL).tocsc()
        points = [(self.nominal.pairs[pair], point) for pair, point in self.nominal.loads]
        self.N = self.spread([pair.P_m[point] for pair, point in points], [pair.n_r[point] for pair, point in points])
        self.holds = np.array([pair.holds for pair, _ in points])
        forces = [(self.nominal.position(force.at), force.vector) for force in self.nominal.assembly.forces]
        self.F = self.spread(*zip(*forces, strict=True)).sum(axis=1)
        self.middle = self.spread([(40, 30, 24)], [(0, 0, 1)])

    def spread(self, points, directions):
        R, t = self.part.placement
        return self.body.spread((np.array(points, dtype=float) - t) @ R, np.array(directions, dtype=float) @ R, None)

    def gaps(self, deviations):
        """The gaps (realization, load) of the nominal assembly with deviations."""
        poses = np.tile(AT_REST, (len(deviations), len(self.nominal.parts)))
        relative = self.program.observe(poses=poses, deviations=deviations)["relative"].reshape(len(deviations), -1, 12)
        gaps = np.empty((len(deviations), len(self.nominal.loads)))
        for column, (k, point) in enumerate(self.nominal.loads):
            pair = self.nominal.pairs[k]
            points = np.full((len(deviations), 1), point)
            gaps[:, column] = pair.nominal_gaps(relative[:, k])[:, point] - pair.offsets.heights(deviations, points)[:, 0]
        return gaps

    def held(self, gaps, active):
        """Displacements of least energy with `active` gaps closed, and reactions."""
        E = self.N[:, np.flatnonzero(active)]
        system = sp.bmat([[self.K / SCALE, E], [E.T, None]]).tocsc()
        right, factors = np.concatenate([self.F / SCALE, -gaps[active]]), splu(system)
        x = factors.solve(right)
        x += factors.solve(right - system @ x)
        reactions = np.zeros(len(gaps))
        reactions[active] = -x[len(self.F) :] * SCALE
        return x[: len(self.F)], reactions


@pytest.mark.parametrize("count", [1, *nightly(20)])
def test_a_cover_lies_on_its_seat_as_its_whole_mesh_does(count):
    """Heights within 1e-5 mm and forces within 0.1 %: an active set that meets all conditions solves the convex problem."""
    program = compiled(cover(38))
    plate, deviations = WholePlate(program), program.draws(seed=1, start=0, stop=count)
    block = simulate_block(program, deviations)
    assert (block.status == Status.RESOLVED).all()
    for k, start in enumerate(plate.gaps(deviations)):
        active = plate.holds | (block.load[k] > 0)
        u, reactions = plate.held(start, active)
        assert (start + plate.N.T @ u)[~active].min() > -1e-8  # nothing penetrates, and nothing pulls
        assert reactions[~plate.holds].min() > -1e-2
        assert block.measured[k, CORRECTED, 0] == pytest.approx((plate.middle.T @ u)[0], abs=1e-5)
        assert block.load[k] == pytest.approx(reactions, abs=1e-3 * reactions.max())
