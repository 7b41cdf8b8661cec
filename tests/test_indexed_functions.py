"""A Function of several elements reads and writes at its columns in arrays, compiled as well as interpreted."""

import casadi as ca
import numpy as np
import pytest

from tolcontact.compilation.functions.argument_columns import ArgumentColumns, Located
from tolcontact.compilation.functions.named import AdaptiveFunction
from tolcontact.compilation.functions.native import NativeFunction

COUNT, ELEMENTS = 7, 3
WAYS = pytest.mark.parametrize("way", [NativeFunction, AdaptiveFunction], ids=["compiled", "interpreted"])


def sum_and_product():
    x, y = ca.SX.sym("x", 2), ca.SX.sym("y", 2)
    return ca.Function("sum_and_product", [x, y], [x + y, ca.dot(x, y)])


def places_of(arrays):
    return [Located.of(array) for array in arrays]


@WAYS
@pytest.mark.parametrize("rows", [1, COUNT])
def test_elements_have_places_in_shared_arrays(way, rows):
    rng = np.random.default_rng(1)
    x = rng.normal(size=(COUNT, 9))[:, 1:7]  # the rows of a slice are apart
    y = rng.normal(size=(rows, 4))  # one row counts for all realizations
    of_x, of_y = rng.integers(0, 6, (ELEMENTS, 2)), rng.integers(0, 4, (ELEMENTS, 2))
    of_sum, of_product = rng.permutation(6).reshape(ELEMENTS, 2), rng.permutation(5)[:ELEMENTS, None]
    sums, products = np.zeros((COUNT, 6)), np.full((COUNT, 5), -1.0)
    way(sum_and_product()).evaluate(COUNT, places_of([x, y, sums, products]), ArgumentColumns([of_x, of_y, of_sum, of_product]))
    for element in range(ELEMENTS):
        a, b = x[:, of_x[element]], np.broadcast_to(y, (COUNT, 4))[:, of_y[element]]
        assert np.array_equal(sums[:, of_sum[element]], a + b)
        assert np.allclose(products[:, of_product[element, 0]], (a * b).sum(axis=1), rtol=1e-14, atol=1e-15)
    assert (products[:, np.setdiff1d(np.arange(5), of_product)] == -1).all()


@WAYS
def test_no_realization_is_no_work(way):
    function, nothing = way(sum_and_product()), np.zeros((0, 2))
    function.evaluate(0, places_of([nothing, nothing, nothing, nothing[:, :1]]), ArgumentColumns.of_one([2, 2, 2, 1]))
    assert [len(result) for result in function([nothing, nothing])] == [0, 0]


def test_rows_with_gaps_are_refused():
    function = NativeFunction(sum_and_product())
    arrays = [np.zeros((COUNT, 8))[:, ::2], np.zeros((COUNT, 2)), np.zeros((COUNT, 2)), np.zeros((COUNT, 1))]
    with pytest.raises(ValueError, match="without gaps"):
        function.evaluate(COUNT, places_of(arrays), ArgumentColumns.of_one([2, 2, 2, 1]))
    arrays[0] = np.zeros((COUNT, 1))
    with pytest.raises(ValueError, match="at least 2 columns"):
        function.evaluate(COUNT, places_of(arrays), ArgumentColumns.of_one([2, 2, 2, 1]))
    arrays[0] = np.zeros((COUNT - 1, 2))
    with pytest.raises(ValueError, match="expected 7 rows, or one"):
        function.evaluate(COUNT, places_of(arrays), ArgumentColumns.of_one([2, 2, 2, 1]))
