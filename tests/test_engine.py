"""The fast ways give what the plain ones give."""

import casadi as ca
import numpy as np
import pytest

import tolcontact as tc
from tests import cases
from tolcontact.discretization import discretize
from tolcontact.simulation import RAW, simulate_blocks
from tolcontact.simulation.run import _observe
from tolcontact.simulation.scan import PairScan, pair_scan
from tolcontact.symbolic import contact_program
from tolcontact.symbolic.batch import Mapped
from tolcontact.symbolic.gap import gap_matrix
from tolcontact.symbolic.gap_map import gap_map
from tolcontact.symbolic.groups import contact_groups
from tolcontact.symbolic.native import OPERATIONS, Native, UnknownInstructionError
from tolcontact.symbolic.plugins import plugin

RNG = np.random.default_rng(5)
MODELS = {"ra1": cases.ra1, "stack": cases.stack, "jaws": cases.jaws, "cover": lambda: cases.model("cover")}


@pytest.mark.parametrize("make", MODELS.values(), ids=MODELS)
@pytest.mark.parametrize("method", [tc.Method(), tc.Method(resolution="exact", objective="locator stiffness")], ids=str)
def test_compiled_functions_equal_interpreted_ones_to_the_last_bit(make, method):
    nominal = discretize(make())
    for group in contact_groups(nominal):
        gaps = [gap_map(gap_matrix(pair)) for pair in nominal.pairs]
        program = contact_program.contact_program(nominal, group, gaps, method, plugin("daqp"))
        for function in (program.assemble, program.finish):
            inputs = [RNG.normal(size=(7, function.nnz_in(k))) for k in range(function.n_in())]
            for found, expected in zip(Native(function)(inputs), Mapped(function)(inputs)[0], strict=True):
                assert np.array_equal(found, expected, equal_nan=True)


def test_every_translated_instruction_does_what_casadi_does():
    x, y = ca.SX.sym("x"), ca.SX.sym("y")
    values = [x + y, x - y, x * y, x / y, -x, x**2, 2 * x, 1 / x, ca.fmin(x, y), ca.fmax(x, y), x < y, x <= y, x == y, x != y]
    values += [ca.logic_not(x), ca.logic_and(x, y), ca.logic_or(x, y), ca.if_else(x > y, y, 0), ca.sqrt(x), ca.fabs(x)]
    values += [ca.sin(x), ca.cos(x), ca.exp(x), ca.log(x)]
    function = ca.Function("f", [x, y], [ca.vertcat(*values)])
    used = {function.instruction_id(k) for k in range(function.n_instructions())}
    assert set(OPERATIONS) - used <= {ca.OP_ASSIGN, ca.OP_FABS}
    special = np.array([0.0, -0.0, 1.0, -2.5, 1e300, np.inf, -np.inf, np.nan])
    grid = [each.reshape(-1, 1) for each in np.meshgrid(special, special)]
    found, expected = Native(function)(grid)[0], Mapped(function)(grid)[0][0]
    assert np.array_equal(found, expected, equal_nan=True)
    assert (np.signbit(found) == np.signbit(expected))[np.isfinite(expected)].all()


def test_an_instruction_without_translation_is_left_to_casadi():
    x = ca.SX.sym("x")
    function = ca.Function("f", [x], [ca.erf(x)])
    with pytest.raises(UnknownInstructionError):
        Native(function)


@pytest.mark.parametrize("activity", [1e-9, 0.3])
@pytest.mark.parametrize("make", [cases.ra1, cases.stack, lambda: cases.model("ra2")], ids=["ra1", "stack", "ra2"])
def test_compiled_scans_equal_those_in_numpy(make, activity):
    program = tc.build(make(), solver="daqp")
    block = next(simulate_blocks(program, samples=50, seed=1))
    _, relative = _observe(program, block.poses[:, RAW])
    _, later = _observe(program, block.poses[:, 1])
    (group,) = program.groups
    for position, index in enumerate(group.group.pairs):
        tables = [side.table for side in group.group.sides if side.pair == position]
        compiled = pair_scan(program.nominal.pairs[index], program.gaps[index], tables, 6)
        plain = PairScan(**{name: getattr(compiled, name) for name in PairScan.__dataclass_fields__})
        (active, moments), expected = (
            scan.survey(relative[:, index], block.deviations, activity) for scan in (compiled, plain)
        )
        assert (active == expected[0]).all()
        assert np.allclose(moments, expected[1], rtol=1e-12, atol=1e-9)
        for mask in (None, plain.gaps(relative[:, index], block.deviations) < activity):
            deepest = [scan.deepest(later[:, index], block.deviations, mask) for scan in (compiled, plain)]
            carried = np.isfinite(deepest[0][1])
            assert (deepest[0][1] == deepest[1][1]).all()
            assert (deepest[0][0][carried] == deepest[1][0][carried]).all()
