"""Welded sheets against a contact problem over all freedoms of their meshes; archives, blocks and threads of elastic parts."""

import numpy as np
import pytest
import scipy.sparse as sp
from scipy.sparse.linalg import splu

import tolcontact as tc
from tests.cases import MODELS, elastic as cases
from tests.helpers import assembly_of, compiled, nightly
from tolcontact.compilation import ACCURACY
from tolcontact.simulation import simulate_block
from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run
from tolcontact.vocabulary import CORRECTED, Status

clarabel = pytest.importorskip("clarabel")
MEASURED = ((150, 100), (550, 200), (400, 0))


class WholeSheets:
    """The sheets with all freedoms of their meshes, linear about the nominal assembly."""

    def __init__(self):
        meshes = {name: cases.sheet_mesh(thickness) for name, (_, thickness) in cases.SHEETS.items()}
        self.nodes = {name: nodes + np.array([cases.SHEETS[name][0], 0, name == "rear"]) for name, (nodes, _) in meshes.items()}
        self.K = sp.block_diag([K for _, K in meshes.values()]).tocsc()
        self.start = {"front": 0, "rear": len(meshes["front"][1])}

    def at(self, name, point, direction):
        """The functional (freedom,) of the displacement of a point."""
        sign, axis = (-1.0 if direction.startswith("-") else 1.0), "xyz".index(direction[-1])
        row = np.zeros(self.K.shape[0])
        node = int(((self.nodes[name] - point) ** 2).sum(axis=1).argmin())
        row[self.start[name] + 3 * node + axis] = sign
        return row

    def place(self, name, x, y):
        return (x, y, float(name == "rear"))

    def across(self, x, y, direction):
        """The functional of the opening between the flanges."""
        return self.at("rear", (x, y, 1.0), direction) - self.at("front", (x, y, 1.0), direction)

    def solved(self, equations, targets, contact):
        """Displacements (freedom,) of least energy that meet the equations, with flanges that do not penetrate each other.

        Clarabel finds the points that touch; the answer solves the linear system with these as equations.
        """
        free = [place for place in cases.FLANGE if contact and place not in cases.WELDED]
        gaps = np.array([self.across(x, y, "z") for x, y in free]).reshape(len(free), self.K.shape[0])
        settings = clarabel.DefaultSettings()
        settings.verbose, settings.tol_gap_abs, settings.tol_gap_rel, settings.tol_feas = False, 1e-12, 1e-12, 1e-12
        A, b = sp.csc_matrix(np.vstack([equations, -gaps])), np.concatenate([targets, np.zeros(len(gaps))])
        cones = [clarabel.ZeroConeT(len(targets)), clarabel.NonnegativeConeT(len(gaps))]
        problem = sp.triu(self.K / 1e3).tocsc(), np.zeros(self.K.shape[0]), A, b, cones, settings
        pushes = np.array(clarabel.DefaultSolver(*problem).solve().z)[len(targets) :]
        touching, size = pushes > 1e-3 * pushes.max(initial=0), np.abs(targets).max()
        for _ in range(10):
            x, multipliers = self.held(
                np.vstack([equations, gaps[touching]]), np.concatenate([targets, np.zeros(touching.sum())])
            )
            forces = np.zeros(len(gaps))
            forces[touching] = multipliers[len(targets) :]
            pulls, inside = forces > 1e-6 * np.abs(forces).max(initial=0), ~touching & (gaps @ x < -1e-7 * size)
            if not (pulls | inside).any():
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
        return x[: self.K.shape[0]], x[self.K.shape[0] :]

    def built(self, deviations, contact):
        """Displacements at the end of the weld and of the check, for deviations (locator,) of both sheets."""
        placed = [self.at(name, self.place(name, x, y), n) for name in cases.SHEETS for x, y, n in cases.PLACED[name]]
        guns = [self.across(x, y, "z") for x, y in cases.WELDED]
        first = self.solved(np.array([*placed, *guns]), np.concatenate([deviations, np.zeros(len(guns))]), contact)
        kept = np.array([self.across(x, y, axis) for x, y in cases.WELDED for axis in "xyz"])
        free = [self.at(name, self.place(name, x, y), n) for name, x, y, n in cases.FREE]
        second = self.solved(np.array([*free, *kept]), np.concatenate([np.zeros(6), kept @ first]), contact)
        return first, second

    def heights(self, displacements):
        names = ["front" if x < 300 else "rear" for x, _ in MEASURED]
        places = [self.at(name, self.place(name, *xy), "z") for name, xy in zip(names, MEASURED, strict=True)]
        return np.array(places) @ displacements


@pytest.mark.parametrize(("contact", "count"), [(True, 3), *nightly((True, 20), (False, 5))])
def test_welded_sheets_spring_back_as_their_whole_meshes_do(tmp_path, contact, count):
    """Heights differ by squares of rotations, which the whole meshes leave out: 1e-4 mm, and a hundredth at a tenth."""
    sheets = WholeSheets()
    for tolerance, within in ((0.05, 1e-4), (0.005, 1e-6)):
        program = compiled(cases.welded_sheets(tmp_path, tolerance=tolerance, contact=contact, measured=MEASURED))
        deviations = program.draws(seed=1, start=0, stop=count)
        block = simulate_block(program, deviations)
        assert (block.status == Status.RESOLVED).all()
        ends = [sheets.built(row[:14] / tolerance, contact) for row in deviations]
        expected = tolerance * np.array([np.concatenate([sheets.heights(end) for end in pair]) for pair in ends])
        assert np.abs(expected[:, 3:]).max() > tolerance / 20  # they spring back
        assert np.abs(block.measured[:, CORRECTED] - expected).max() < within


def test_an_archive_of_welded_sheets_is_recomputed_and_resumed_to_the_same_bits(tmp_path):
    model = cases.welded_sheets(tmp_path)
    whole, parts = tmp_path / "whole.nc", tmp_path / "parts.nc"
    tc.run(model, samples=24, seed=2, out=whole)
    assert_resolved(whole)
    assert_gaps_recompute(whole)
    with tc.open_archive(whole) as tree:
        assert tree.gap_min.values[:, CORRECTED].min() > -ACCURACY
        group, check = tree["elastic"].to_dataset(), tree["station/check"].to_dataset().sel(state="corrected")
        bent = group.reaction_at_load.values @ group.measured_by_load.values.T + group.measured_by_forces.values
        R, t = (check[f"station_{name}"].sel(station_part="rear").values for name in ("rotation", "translation"))
        corner = (550.0, 200.0, 1.0)
        height = (R @ corner + t)[:, 2] - corner[2] + bent[:, 3]
        assert np.abs(bent[:, 3]).max() > 1e-4
        assert tree.measured.values[:, CORRECTED, 3] == pytest.approx(height, abs=1e-6)  # u is turned by R, to second order
        assert tc.io.model_of(tree).parts[0].elasticity.stiffness == tmp_path / "front.npz"
    tc.run(model, samples=8, seed=2, out=parts)
    tc.run(model, samples=24, seed=2, out=parts, resume=True)
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
