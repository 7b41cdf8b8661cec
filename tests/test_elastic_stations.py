"""Welded sheets against a contact problem over all freedoms of their meshes; archives, blocks and threads of elastic parts."""

from dataclasses import replace

import netCDF4
import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases import MODELS, elastic as cases
from tests.helpers import assembly_of, compiled, nightly
from tolcontact.compilation import ACCURACY
from tolcontact.discretization import discretize
from tolcontact.errors import ModelError, NominalWarning
from tolcontact.simulation import simulate_block
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.vocabulary import CORRECTED, Status

clarabel = pytest.importorskip("clarabel")
MEASURED = ((150, 100), (550, 200), (400, 0))


class WholeSheets:
    """The sheets with all freedoms of their meshes, about poses whose rotations are finite or, as a `linear` model, nominal.

    Forms raise the faces of the flanges: `raised` has the sum of both heights by place (x, y). Unknowns are the displacements
    of all nodes, which have no mean rigid motion at the nodes of the matrices in a folder, and the increments (translation,
    rotation) of both poses.
    """

    def __init__(self, folder, *, linear=False, raised=None):
        self.linear, self.raised = linear, raised or {}
        meshes = {name: cases.sheet_mesh(thickness) for name, (_, thickness) in cases.SHEETS.items()}
        self.nodes = {name: nodes + np.array([cases.SHEETS[name][0], 0, name == "rear"]) for name, (nodes, _) in meshes.items()}
        sizes = [len(K) for _, K in meshes.values()]
        self.start, self.size = dict(zip(meshes, (0, sizes[0]), strict=True)), sum(sizes)
        self.K = sp.block_diag([*(K for _, K in meshes.values()), sp.csc_matrix((12, 12))]).tocsc()
        self.poses = {name: (np.eye(3), np.zeros(3)) for name in meshes}
        rows = []
        for name, (nodes, _) in meshes.items():
            kept = np.load(folder / f"{name}.npz")["nodes"]
            freedoms = 3 * np.array([((nodes - node) ** 2).sum(axis=1).argmin() for node in kept])[:, None] + np.arange(3)
            rows.append(np.zeros((6, self.size + 12)))
            rows[-1][:, self.start[name] + freedoms.ravel()] = cases.rigid_motions(kept).T
        self.means = np.vstack(rows)

    def place(self, name, x, y):
        return np.array([x, y, float(name == "rear")])

    def shift(self, name, point, n):
        """The row (unknown,) of the displacement of a nodal point of a sheet."""
        row, node = np.zeros(self.size + 12), int(((self.nodes[name] - point) ** 2).sum(axis=1).argmin())
        row[self.start[name] + 3 * node : self.start[name] + 3 * node + 3] = n
        return row

    def at(self, name, point, direction):
        """How far a point of a sheet has moved at its pose, and the row (unknown,) of how much further it moves."""
        n = (-1.0 if direction.startswith("-") else 1.0) * np.eye(3)["xyz".index(direction[-1])]
        (R, t), row = self.poses[name], self.shift(name, point, n)
        x = R @ point + t
        first = self.size + 6 * list(self.nodes).index(name)
        row[first : first + 6] = [*n, *np.cross(x, n)]
        return n @ (x - point), row

    def across(self, x, y, direction):
        """The opening between the flanges, with form, along a normal that rotates with the front sheet, and its row."""
        point, n = np.array([x, y, 1.0]), np.eye(3)["xyz".index(direction[-1])]
        (R, t), (R_r, t_r) = self.poses["rear"], self.poses["front"]
        x_m, normal = R @ point + t, R_r @ n
        row = self.shift("rear", point, n) - self.shift("front", point, n)
        slopes = np.array([*normal, *np.cross(x_m, normal)])
        row[self.size :] = [*-slopes, *slopes]
        return n @ (R_r.T @ (x_m - t_r) - point) - self.raised.get((x, y), 0.0) * n[2], row

    def solved(self, conditions, targets, contact, size):
        """Unknowns of least energy where conditions (value, row) meet targets, and flanges do not penetrate each other."""
        self.touching = None
        for _ in range(1 if self.linear else 4):
            values, rows = (np.array(column) for column in zip(*conditions(), strict=True))
            free = [place for place in cases.FLANGE if contact and place not in cases.WELDED]
            gaps = [self.across(x, y, "z") for x, y in free] or [(0.0, np.zeros(self.size + 12))]
            openings, slopes = (np.array(column) for column in zip(*gaps, strict=True))
            equations = np.vstack([rows, self.means])
            x = size * self.least(equations, np.concatenate([targets - values, np.zeros(12)]) / size, slopes, -openings / size)
            if not self.linear:
                for k, (name, (R, t)) in enumerate(self.poses.items()):
                    tau, rho = x[self.size + 6 * k :][:3], x[self.size + 6 * k :][3:6]
                    turn = Rotation.from_rotvec(rho).as_matrix()
                    self.poses[name] = turn @ R, turn @ t + tau
                x[self.size :] = 0
        return x

    def least(self, equations, targets, gaps, least):
        """Unknowns of least energy that meet equations, with gaps of at least `least`.

        Clarabel finds the points that touch; the answer solves the linear system with these as equations.
        """
        touching, size = self.touching, np.abs(targets).max()
        if touching is None:
            settings = clarabel.DefaultSettings()
            settings.verbose, settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = False, 1e-12, 1e-12, 1e-12
            A, b = sp.csc_matrix(np.vstack([equations, -gaps])), np.concatenate([targets, -least])
            cones = [clarabel.ZeroConeT(len(targets)), clarabel.NonnegativeConeT(len(gaps))]
            problem = sp.triu(self.K / 1e3).tocsc(), np.zeros(self.K.shape[0]), A, b, cones, settings
            pushes = np.array(clarabel.DefaultSolver(*problem).solve().z)[len(targets) :]
            touching = (pushes > 1e-3 * pushes.max(initial=0)) & gaps.any(axis=1)
        for _ in range(10):
            x, multipliers = self.held(np.vstack([equations, gaps[touching]]), np.concatenate([targets, least[touching]]))
            self.forces = np.zeros(len(gaps))
            self.forces[touching] = multipliers[len(targets) :]
            pulls = self.forces > 1e-6 * np.abs(self.forces).max(initial=0)
            inside = ~touching & (gaps @ x < least - 1e-7 * size)
            if not (pulls | inside).any():
                self.touching = touching
                return x
            touching = touching & ~pulls | inside
        raise AssertionError("the points that touch are not found")

    def held(self, equations, targets):
        """Displacements and multipliers of least energy that meet equations, for targets (equation,) or (equation, case)."""
        scale = abs(self.K).max()
        system = sp.bmat([[self.K / scale, sp.csc_matrix(equations).T], [sp.csc_matrix(equations), None]]).tocsc()
        right = np.concatenate([np.zeros((self.K.shape[0], *targets.shape[1:])), targets])
        factors = splu(system)
        x = factors.solve(right)
        x += factors.solve(right - system @ x)
        return x[: self.K.shape[0]], scale * x[self.K.shape[0] :]

    def built(self, deviations, contact):
        """Heights at the end of the weld and of the check, for deviations (locator,) of both sheets."""
        size = np.abs(deviations).max()
        self.poses = {name: (np.eye(3), np.zeros(3)) for name in self.nodes}

        def placed():
            fixed = [self.at(name, self.place(name, x, y), n) for name in cases.SHEETS for x, y, n in cases.PLACED[name]]
            return fixed + [self.across(x, y, "z") for x, y in cases.WELDED]

        def welds():
            return [self.across(x, y, axis) for x, y in cases.WELDED for axis in "xyz"]

        def released():
            return [self.at(name, self.place(name, x, y), n) for name, x, y, n in cases.FREE] + welds()

        first = self.solved(placed, np.concatenate([deviations, np.zeros(len(cases.WELDED))]), contact, size)
        ends, self.loads = [self.heights(first)], [-size * self.forces]
        kept = [value + row @ first for value, row in welds()]
        second = self.solved(released, np.concatenate([np.zeros(6), kept]), contact, size)
        self.loads.append(-size * self.forces)
        return np.concatenate([*ends, self.heights(second)])

    def heights(self, x):
        names = ["front" if place < 300 else "rear" for place, _ in MEASURED]
        moved = [self.at(name, self.place(name, *xy), "z") for name, xy in zip(names, MEASURED, strict=True)]
        return np.array([value + row @ x for value, row in moved])


def flange_forces(program, block):
    """The reactions (n, station, point) [N] of the flanges where they are not welded."""
    pairs = [k for k, pair in enumerate(program.nominal.pairs) if pair.name.startswith("flange")]
    loads = program.nominal.loads
    places = [(k, program.nominal.pairs[k].P_r[:, :2].round(6).tolist()) for k in pairs]
    free = [list(place) for place in cases.FLANGE if place not in cases.WELDED]
    columns = [[np.flatnonzero((loads == (k, P.index(place))).all(axis=1))[0] for place in free] for k, P in places]
    return block.load[:, columns]


def with_form(model, flatness):
    """The model with form on both faces of the flange."""
    for part, side in zip(model.parts, ("+z", "-z"), strict=True):
        part.feature("flange", part.face(side), tc.Flatness(flatness))
    return model


def raised_places(program, deviations):
    """The sums of the heights of both forms by place (x, y) of the flange, for deviations (contributor,)."""
    points = np.array([(x, y, 1.0) for x, y in cases.FLANGE])
    heights = sum(face.form.heights(points) @ deviations[face.form_columns] for face in program.nominal.faces)
    return dict(zip(cases.FLANGE, heights, strict=True)) if program.nominal.faces else {}


@pytest.mark.parametrize(
    ("contact", "tolerance", "flatness", "count"),
    [
        (True, 0.05, 0.1, 1),
        *nightly((True, 0.05, 0, 20), (True, 0.005, 0, 20), (False, 0.05, 0, 5), (True, 0.05, 0.1, 5), (False, 0.05, 0.1, 5)),
    ],
)
def test_welded_sheets_spring_back_as_their_whole_meshes_do(tmp_path, contact, tolerance, flatness, count):
    """A linear model, without finite rotations, differs by their squares: by 1e-4 mm, and a hundredth at a tenth."""
    model = cases.welded_sheets(tmp_path, tolerance=tolerance, contact=contact, measured=MEASURED)
    program = compiled(with_form(model, flatness) if flatness else model)
    deviations = program.draws(seed=1, start=0, stop=count)
    block = simulate_block(program, deviations)
    assert (block.status == Status.RESOLVED).all()
    forces = flange_forces(program, block) if contact else 0
    for linear in (False, True) if count > 1 and not flatness else (False,):
        expected, loads = [], []
        for row in deviations:
            sheets = WholeSheets(tmp_path, linear=linear, raised=raised_places(program, row))
            expected.append(sheets.built(row[:14], contact))
            loads.append(np.array(sheets.loads))
        error, within = np.abs(block.measured[:, CORRECTED] - expected).max(), 0.04 * tolerance**2 if linear else 1e-7
        assert np.abs(np.array(expected)[:, 3:]).max() > tolerance / 20  # they spring back
        assert error < within
        if contact and not linear:
            assert forces == pytest.approx(np.array(loads), abs=1e-6 * np.max(loads))
            assert (np.max(loads, axis=2) > 0).all()


def with_contact(model, roles):
    """The model with contact of the flanges: `roles` are the numbers of the moving and the reference part."""
    for station in model.stations:
        moving, reference = (model.parts[k].face(("+z", "-z")[k]) for k in roles)
        station.contact(f"flange in {station.name}", moving=moving, reference=reference, within=0.5)
    return model


@pytest.mark.parametrize("flatness", [*nightly(0), 0.01])
def test_flanges_have_one_answer_whichever_moves_and_guns_hold_where_they_are(tmp_path, flatness):
    """Normals of either face differ by the rotations of sheets: answers by their squares, and rows of one point contradict."""
    answers = []
    for roles in ((1, 0), (0, 1)):
        model = with_contact(cases.welded_sheets(tmp_path, tolerance=0.005, contact=False, measured=MEASURED), roles)
        program, out = compiled(with_form(model, flatness) if flatness else model), tmp_path / f"{roles[0]}.nc"
        pairs = [pair for pair in program.nominal.pairs if pair.name.startswith("flange")]
        assert [len(pair.P_m) for pair in pairs] == [len(cases.FLANGE) - len(cases.WELDED)] * 2
        block = simulate_block(program, program.draws(seed=1, start=0, stop=8))
        assert (block.status == Status.RESOLVED).all()
        answers.append(block.measured[:, CORRECTED])
        tc.run(program, samples=8, seed=1, out=out).close()
        assert_gaps_recompute(out)
    assert np.abs(answers[1] - answers[0]).max() < 1e-3 * np.ptp(answers[0], axis=0).max()


def test_guns_follow_the_faces_that_they_hold_and_contact_at_guns_alone_is_refused(tmp_path):
    model = cases.welded_sheets(tmp_path, contact=False)
    front, rear = model.parts
    front.feature("edge", front.face("+z", tc.select.Inside((240, -1, 0), (301, 60, 2))), tc.Flatness(0.1))
    rear.feature("top", rear.face("+z"), tc.Flatness(0.1))  # which guns do not touch
    nominal = discretize(model)
    guns = [pair for pair in nominal.pairs if pair.name.startswith("guns")]
    assert [(pair.name, len(pair.P_m)) for pair in guns] == [("guns of weld.rail", 2), ("guns of weld.rail 2", 3)]
    assert [[face and face.name for face in pair.deviating] for pair in guns] == [[None, "front.edge"], [None, None]]
    model = with_contact(cases.welded_sheets(tmp_path, contact=False), (1, 0))
    points = tuple(model.parts[0].point(x, y, 1) for x, y in cases.FLANGE)
    with pytest.raises(
        ModelError, match='contact pair "flange in weld": guns or welds hold its parts at all its contact points'
    ):
        compiled(model.replaced(joints=[replace(model.joints[0], at=points)]))


def test_an_archive_of_welded_sheets_is_recomputed_and_resumed_to_the_same_bits(tmp_path):
    model = cases.welded_sheets(tmp_path)
    whole, parts = tmp_path / "whole.nc", tmp_path / "parts.nc"
    program = compiled(model)
    tc.run(program, samples=12, seed=2, out=whole)
    assert_resolved(whole)
    assert_gaps_recompute(whole)
    with tc.open_archive(whole) as tree:
        assert tree.gap_min.values[:, CORRECTED].min() > -ACCURACY
        assert tree.attrs["solver"] == "qpoases" and tree.attrs["solver_second"].startswith("graph, ")
        assert (tree.second_answers >= 2).all()  # QPs of both stations: graph has answered them
        group, check = tree["elastic"].to_dataset(), tree["station/check"].to_dataset().sel(state="corrected")
        bent = group.reaction_at_load.values @ group.measured_by_load.values.T + group.measured_by_forces.values
        R, t = (check[f"station_{name}"].sel(station_part="rear").values for name in ("rotation", "translation"))
        corner = (550.0, 200.0, 1.0)
        height = (R @ corner + t)[:, 2] - corner[2] + bent[:, 3]
        assert np.abs(bent[:, 3]).max() > 1e-4
        assert tree.measured.values[:, CORRECTED, 3] == pytest.approx(height, abs=1e-6)  # u is turned by R, to second order
        assert tc.io.model_of(tree).parts[0].elasticity.stiffness == tmp_path / "front.npz"
    tc.run(program, samples=5, seed=2, out=parts).close()
    with netCDF4.Dataset(parts, "a") as file:
        file.solver_second = "qpoases, daqp, piqp"  # as earlier versions wrote, which did not count these answers
    tc.run(program, samples=12, seed=2, out=parts, resume=True)
    assert_same_run(whole, parts)
    with tc.open_archive(whole) as tree, tc.open_archive(parts) as resumed:
        field, again = (results["field/rear"].to_dataset() for results in (tree, resumed))
        assert again.six_sigma.values == pytest.approx(field.six_sigma.values, abs=1e-12)
        corner = np.abs(field.vertices.values - (550, 200, 1)).sum(axis=1).argmin()
        spread = field.six_sigma.sel(state="corrected", component="z").values[corner]
        assert spread == pytest.approx(6 * tree.measured.values[:, CORRECTED, 3].std(ddof=1), abs=1e-6)


def test_blocks_and_threads_change_no_bit(tmp_path):
    program = compiled(cases.welded_sheets(tmp_path))
    (whole,) = tc.simulate_blocks(program, samples=12, seed=3, threads=1)
    deviations = program.draws(seed=3, start=0, stop=12)
    for rows in (slice(0, 5), slice(5, 12), slice(7, 8)):
        part = simulate_block(program, deviations[rows])
        for name in ("measured", "poses", "load", "weld_gap"):
            assert (getattr(part, name) == getattr(whole, name)[rows]).all(), name
    (again,) = tc.simulate_blocks(program, samples=12, seed=3, threads=2)
    assert (again.load == whole.load).all()


def test_the_model_of_welded_sheets_varies_less_once_it_is_released():
    program = compiled(assembly_of(MODELS / "welded_sheets.py"))
    block = simulate_block(program, program.draws(seed=1, start=0, stop=12))
    assert (block.status == Status.RESOLVED).all()
    clamped, released = block.measured[:, CORRECTED].std(axis=0)
    assert released < 0.8 * clamped


def test_a_tolerance_of_a_welded_sheet_that_nothing_depends_on_is_named(tmp_path):
    """Gaps that welds keep are inputs after the deviations, and no columns of a tolerance."""
    model = cases.welded_sheets(tmp_path)
    rear = model.parts[1]
    rear.feature("top", rear.face("+z"), tc.Flatness(0.1))
    with pytest.warns(NominalWarning, match='part "rear": feature "top" .*: its tolerances have no effect'):
        tc.build(model)
