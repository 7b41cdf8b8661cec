"""A Function of several elements reads and writes at its places in arrays, compiled as well as interpreted."""

import casadi as ca
import numpy as np
import pytest

from tolcontact.compilation.functions import NamedFunction, named

COUNT, ELEMENTS = 7, 3


def sum_and_product() -> NamedFunction:
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y", 2)
    return NamedFunction(ca.Function("f", [x, y], [x + y, ca.dot(x, y)], ["x", "y"], ["sum", "product"]))


@pytest.mark.parametrize("calls", [0, 10**9], ids=["compiled", "interpreted"])
@pytest.mark.parametrize("rows", [1, COUNT])
def test_elements_have_places_in_shared_arrays(monkeypatch, calls, rows):
    monkeypatch.setattr(named, "MIN_COMPILED_CALLS", calls)
    rng = np.random.default_rng(1)
    wide, y = rng.normal(size=(COUNT, 9)), rng.normal(size=(rows, 4))
    x = wide[:, 1:7]  # the rows of a slice are apart
    places = {
        "x": rng.integers(0, 6, (ELEMENTS, 2)), "y": rng.integers(0, 4, (ELEMENTS, 2)),
        "sum": rng.permutation(6).reshape(ELEMENTS, 2), "product": rng.permutation(5)[:ELEMENTS, None],
    }  # fmt: skip
    results = {"sum": np.zeros((COUNT, 6)), "product": np.full((COUNT, 5), -1.0)}
    function = sum_and_product().at(places)
    for _ in range(2):  # the first call looks for machine code, the second one compiles
        function(COUNT, {"x": x, "y": y, **results})
    for element in range(ELEMENTS):
        a = x[:, places["x"][element]]
        b = np.broadcast_to(y, (COUNT, 4))[:, places["y"][element]]
        assert np.array_equal(results["sum"][:, places["sum"][element]], a + b)
        assert np.allclose(results["product"][:, places["product"][element, 0]], (a * b).sum(axis=1), rtol=1e-15, atol=1e-15)
    untouched = np.setdiff1d(np.arange(5), places["product"])
    assert (results["product"][:, untouched] == -1).all()


def test_rows_with_gaps_are_refused(monkeypatch):
    monkeypatch.setattr(named, "MIN_COMPILED_CALLS", 0)
    first = np.zeros((1, 1), dtype=int)
    function = sum_and_product().at({**dict.fromkeys(("x", "y", "sum"), np.array([[0, 1]])), "product": first})
    arrays = {name: np.zeros((COUNT, 4)) for name in ("x", "y", "sum", "product")}
    function(COUNT, arrays)  # the first call looks for machine code, the second one compiles
    with pytest.raises(ValueError, match="without gaps"):
        function(COUNT, arrays | {"x": np.zeros((COUNT, 8))[:, ::2]})
