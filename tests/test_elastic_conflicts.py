"""Elastic parts that cannot be as they are declared: locators that contradict each other, no pose, and nothing that holds."""

import warnings
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import tolcontact as tc
from tests.cases import elastic as cases
from tests.helpers import compiled, nightly, simulate
from tests.test_elastic_parts import tips
from tolcontact.errors import ModelError, NominalWarning
from tolcontact.simulation import simulate_block
from tolcontact.testing import assert_gaps_recompute
from tolcontact.vocabulary import CERTIFIED, CORRECTED, Status

FEET = [(x, y, 0.0) for x in (10.0, 200.0, 390.0) for y in (0.0, 20.0)]
SIDES = [((10, 0, 0), "y"), ((390, 0, 0), "y"), ((10, 20, 0), "x")]
ABOVE = (200, 10, 10)


def beam(folder, feet=range(6), *others, one_sided=False, press=-100.0, turned=False):
    """A beam on some of six feet, soft in bending, with further locators (place, direction[, one-sided])."""
    nodes = np.array([*FEET, ABOVE], dtype=float)
    middle = [(1 / 3, 200, y) for y in (0, 10, 20)]
    bend = cases.lifts(nodes, *middle, *((-0.25, x, y) for x in (10, 390) for y in (0, 20)))
    model = tc.Assembly("beam", method=tc.Method(objective="seating"))
    R, place = ((0.3, -1.1, 2.0), (500, -80, 33)) if turned else ((0, 0, 0), (0, 0, 0))
    part = model.part("beam", tc.Box(400, 20, 10), rotation=R, at=place)
    part.elastic(**cases.saved(folder, "beam", nodes, cases.stiffness(nodes, bend, [300.0], stiff=9000.0)))
    places = [*((FEET[k], "z", one_sided) for k in feet), *(others or SIDES)]
    scheme = [tc.Locator(f"L{k}", point, *n[:1], one_sided=any(n[1:])) for k, (point, *n) in enumerate(places)]
    model.locate(part, scheme, tolerance=0.6)
    model.force("press", at=part.point(*ABOVE), vector=Rotation.from_rotvec(R).apply((0, 0, press)))
    model.measure("middle", part.point(200, 0, 0), along=Rotation.from_rotvec(R).apply((0, 0, 1)), tolerance=1)
    return model


@pytest.mark.parametrize(
    ("feet", "others", "fault"),
    [
        (range(6), [*SIDES, ((200, 0, 0), "z")], r'its two-sided locators "beam.L2", "beam.L9" contradict each other'),
        (
            range(6),
            [*SIDES, ((10, 20, 0), "y"), ((10, 20, 0), (0.6, 0.8, 0))],
            r'two-sided locators "beam.L8", "beam.L9", "beam.L10" contradict each other .*leave one of them out',
        ),
        (range(6), SIDES[:2], "its 8 locators do not fix it: the locator matrix has condition number"),
        (range(6), [*SIDES[:2], ((10, 20, 0), "y")], "its 9 locators do not fix it: the locator matrix"),
        ((0, 2, 4), SIDES, "beam.L0, beam.L1, beam.L2 hold the same, so they contradict each other and leave a direction free"),
        ((0, 1), SIDES, "it has 5 locators; a part needs six independent ones"),
    ],
)
def test_locators_that_contradict_each_other_or_leave_it_free_are_refused_by_their_names(tmp_path, feet, others, fault):
    with pytest.raises(ModelError, match=f'part "beam" .*{fault}'):
        compiled(beam(tmp_path, feet, *others))


def test_locators_close_to_each_other_are_no_conflict(tmp_path):
    """Nine at six nodes bend the beam; and a tenth at a node, across to what is held there, holds another direction."""
    _, run = simulate(beam(tmp_path, range(6), *SIDES, ((200, 0, 0), (0, 0.1, 1))), samples=8)
    assert (run["status"] == Status.RESOLVED).all()


def names_in_conflict(program, run):
    """The pairs that keep a gap, or penetrate, in each realization that is not assemblable: a set of sets."""
    stuck = run["gap_min"][run["status"] == Status.NOT_ASSEMBLABLE, CORRECTED] < -1e-6
    return {
        frozenset(pair.name for pair, is_stuck in zip(program.nominal.pairs, row, strict=True) if is_stuck) for row in stuck
    }


@pytest.mark.parametrize("solver", ["qpoases", "graph", *nightly("daqp", "osqp", "piqp")])
@pytest.mark.parametrize("one_sided", [False, True])
def test_a_stop_that_cannot_be_passed_is_not_assemblable_and_named(tmp_path, solver, one_sided):
    """A foot and a stop hold the same node from both sides: no pose where the stop is lower than the foot, by any bending."""
    model = beam(tmp_path, range(6), *SIDES, ((200, 0, 0), "-z", True), one_sided=one_sided)
    program, run = simulate(model, samples=24, solver=solver)
    foot, stop = (run["deviations"][:, program.nominal.contributors.index(f"beam.{name}")] for name in ("L2", "L9"))
    overlaps = foot + stop > 0
    assert 0 < overlaps.sum() < 24
    assert np.isin(run["status"][~overlaps], CERTIFIED).all()
    assert (run["status"][overlaps] == Status.NOT_ASSEMBLABLE).all()
    assert names_in_conflict(program, run) == {frozenset(["supports of beam", *(() if one_sided else ("beam.L2",))])}
    left = -run["gap_min"][overlaps, CORRECTED].min(axis=1)  # both open by half of what they overlap
    assert left == pytest.approx((foot + stop)[overlaps] / 2, rel=1e-3)


@pytest.mark.parametrize("solver", ["qpoases", "graph", *nightly("daqp", "piqp")])
def test_blocks_and_threads_change_no_bit_where_rows_contradict_each_other(tmp_path, solver):
    program = compiled(beam(tmp_path, range(6), *SIDES, ((200, 0, 0), "-z", True), one_sided=True), solver=solver)
    (whole,) = tc.simulate_blocks(program, samples=24, seed=3, threads=1)
    (again,) = tc.simulate_blocks(program, samples=24, seed=3, threads=2)
    assert len(np.unique(whole.status)) > 1 and (whole.status == Status.NOT_ASSEMBLABLE).any()
    deviations = program.draws(seed=3, start=0, stop=24)
    blocks = [(rows, simulate_block(program, deviations[rows])) for rows in (slice(0, 7), slice(7, 24), slice(11, 12))]
    for rows, part in [(slice(0, 24), again), *blocks]:
        for name in ("measured", "poses", "load", "gap_min", "kkt_residual", "second_answers"):
            assert (getattr(part, name) == getattr(whole, name)[rows]).all(), name


def test_conflicts_of_a_beam_do_not_depend_on_its_place_and_are_recomputed(tmp_path):
    """Turned in space, the same realizations are not assemblable, and an archive tells by how much."""
    overlaps = []
    for turned in (False, True):
        model = beam(tmp_path, range(6), *SIDES, ((200, 0, 0), "-z", True), turned=turned)
        with tc.run(compiled(model), samples=16, seed=3, out=tmp_path / f"{turned}.nc") as results:
            overlaps.append(np.where(results.status == Status.NOT_ASSEMBLABLE, results.gap_min[:, CORRECTED].min("pair"), 0))
            counts = tc.summarize(results)["conflicts"].to_series()
        assert_gaps_recompute(tmp_path / f"{turned}.nc")
        assert counts["beam.L2"] == counts["supports of beam"] == (overlaps[0] < 0).sum() > 0 == counts["beam.L1"]
    assert overlaps[1] == pytest.approx(overlaps[0], abs=1e-5)


@pytest.mark.parametrize("feet", [range(6), *nightly(((2, 3, 4, 5),))])
def test_a_beam_that_nothing_holds_down_is_never_certified(tmp_path, feet):
    """Lifted off its feet, it is adrift."""
    _, run = simulate(beam(tmp_path, feet, press=100.0, one_sided=True), samples=8)
    assert (run["status"] == Status.NOT_CONVERGED).all()
    assert np.isinf(run["kkt_residual"]).all()
    with pytest.warns(NominalWarning, match=r"\[bending\] the nominal assembly, which has elastic parts, is not_converged"):
        tc.build(beam(tmp_path, feet, press=100.0, one_sided=True))


@pytest.mark.parametrize(("press", "doubts"), [(-10.0, 0), (-200_000.0, 1)])
def test_the_check_states_sizes_and_bending_and_doubts_what_is_too_much(tmp_path, press, doubts):
    """300 N/mm of the middle against the ends: on its ends, the beam bends there by 667 mm under 200 kN, in a linear theory."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        program = tc.build(beam(tmp_path, (0, 1, 4, 5), press=press, one_sided=True))
    texts = [str(warning.message) for warning in caught if "[bending]" in str(warning.message)]
    assert len(texts) == doubts and all('part "beam"' in text and "beyond a theory of small" in text for text in texts)
    (line,) = program.elastic_parts_in_words
    K, nodes = (np.load(tmp_path / "beam.npz")[name] for name in ("K", "nodes"))
    force = np.zeros(nodes.size)
    force[-1] = press
    Q = cases.rigid_motions(nodes)  # nodes have equal shares, so the mean rigid motion is the projection onto these
    u = np.linalg.pinv(K, rcond=1e-9, hermitian=True) @ (force - Q @ (Q.T @ force))
    largest = np.linalg.norm(u.reshape(-1, 3)[2])  # of the measured place, in the middle
    assert line.startswith("elastic part beam: 7 nodes, 21 freedoms, 7 reactions, mass unknown, bent by ")
    assert float(line.split("bent by ")[1].split()[0]) == pytest.approx(largest, rel=5e-3)


def test_gravity_of_a_part_whose_mass_is_unknown_names_the_part(tmp_path):
    model = beam(tmp_path)
    model.gravity((0, 0, -9.81))
    with pytest.raises(ModelError, match=r'part "beam" .*: its mass is unknown, so it has no weight; give a density'):
        compiled(model)


def test_locators_and_guns_at_both_tips_contradict_each_other_and_are_named(tmp_path):
    """Guns close the gap between two tips, and a locator holds each of them: their heights differ, whatever bends."""
    model = tips(tmp_path)
    held = [
        replace(location, scheme=(*location.scheme, tc.Locator("D", place, "z", tolerance=0.1)))
        for location, place in zip(model.locations[:2], ((92, 10, 1), (8, 10, 0)), strict=True)
    ]
    program, run = simulate(model.replaced(locations=[*held, *model.locations[2:]]), samples=6)
    assert (run["status"] == Status.NOT_ASSEMBLABLE).all()
    assert names_in_conflict(program, run) == {frozenset(["weld.left.D", "weld.right.D", "guns of weld.tips"])}
    _, run = simulate(model.replaced(locations=[held[0], *model.locations[1:]]), samples=6)
    assert (run["status"] == Status.RESOLVED).all()  # a single one bends the other tip
