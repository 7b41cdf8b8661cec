"""Asserts for tests of your own models: is every realization resolved, are the archived gaps true, are two runs the same?

`results` is what `tc.run` or `tc.open_archive` returns, or the path of an archive.

    import tolcontact as tc
    from tolcontact.testing import assert_gaps_recompute, assert_resolved, assert_same_run

    def test_my_assembly():
        results = tc.run("models/ra1.py", samples=200, seed=1)
        assert_resolved(results)
        assert_gaps_recompute(results)
        assert_same_run(results, "expected.nc")
"""

import contextlib
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive import open_archive
from tolcontact.errors import OptionError
from tolcontact.recomputed import ArchivedPair, NotKeptError, Rows

Results = xr.DataTree | str | Path
FIRST = 5  # realizations that a message names
AT_ONCE = 500_000  # gaps that are computed at once


def assert_resolved(results: Results) -> None:
    """Every realization has a certificate: its status is `untouched` or `resolved`.

    Raises AssertionError with the number of the others, by status, and the first of each.
    """
    with _opened(results) as tree:
        status, numbers = _rows(tree)[terms.STATUS.name].values, _numbers(tree)
    others = ~np.isin(status, terms.CERTIFIED)
    if others.any():
        by_status = [f"{_meaning(one)} {_some(numbers[status == one])}" for one in np.unique(status[others])]
        raise AssertionError(f"{others.sum()} of {status.size} realizations are not resolved: {', '.join(by_status)}")


def assert_gaps_recompute(results: Results, *, within: float = terms.ROUNDED) -> None:
    """The least gaps `gap_min` (realization, state, pair) [mm] are those of the archived points, poses and deviations.

    They are computed again with nothing but what the archive holds: n'(x_m - x_r), with x = R p + t, p a nominal contact point
    of the moving or the reference part, n the nominal normal turned with the reference part; less the deviation of the
    one-sided locator that a point stands for. Where a ball or a shaft touches a wall it is their distance, from their sizes and
    places. Faces of features are displaced in their parts first, and lie farther out by their heights. The two may differ by
    `within` [mm].

    Unfinished realizations are passed over, and those whose `searched` is 1: their contact points were projected again, and are
    not archived. (Archives of format 1 do not say which; all of theirs are computed.)

    Raises AssertionError with the largest difference and where it is; also if the archive does not hold the poses (or, for
    one-sided locators, the deviations).
    """
    with _opened(results) as tree:
        rows, numbers = _rows(tree), _numbers(tree)
        archived, held = rows[terms.GAP_MIN.name], _holds_its_points(rows)
        largest, place = 0.0, ""
        for number, name in enumerate(archived[terms.PAIR].values):
            pair = ArchivedPair(tree, number)
            at_once = max(1, AT_ONCE // len(pair.normal))
            for start in range(0, len(held), at_once):
                some = slice(start, start + at_once)
                apart = np.abs(_least_gaps(pair, rows, some) - archived[some, :, number].values)[held[some]]
                apart[np.isnan(apart)] = np.inf
                if apart.max(initial=0.0) > largest:
                    largest = float(apart.max())
                    row, state = np.argwhere(apart == largest)[0]
                    place = f'realization {numbers[some][held[some]][row]}, {terms.STATES[state]}, contact pair "{name}"'
    if largest > within:
        raise AssertionError(
            f'"{terms.GAP_MIN.name}" is not the smallest gap of the archived contact points: it differs by {largest:.3g} mm in '
            f"{place}; {within:.3g} mm are allowed"
        )


def assert_same_run(a: Results, b: Results, *, variables: Sequence[str] | None = None) -> None:
    """Two runs came to the same in every realization, to the last bit (NaN equals NaN).

    Compared are labels and all variables of realizations, or those that are named: "measured", "gap_min", ...
    How the runs came about (attributes, history, solver) and displacement fields are not compared.

    Raises AssertionError with the number of variables that differ, and the first realization of the first of them.
    """
    known = [variable.name for variable in terms.BY_REALIZATION]
    if unknown := [name for name in variables or () if name not in known]:
        raise OptionError(f"no realization has {', '.join(map(repr, unknown))}; expected some of: {', '.join(known)}")
    with _opened(a) as one, _opened(b) as other:
        for dim in (terms.PART, terms.PAIR, terms.MEASURE):
            labels = [[str(label) for label in tree.coords[dim].values] for tree in (one, other)]
            if labels[0] != labels[1]:
                raise AssertionError(f"the labels of {dim} differ: {labels[0]} and {labels[1]}")
        sizes = [tree.sizes[terms.REALIZATION] for tree in (one, other)]
        if sizes[0] != sizes[1]:
            raise AssertionError(f"the runs have {sizes[0]} and {sizes[1]} realizations")
        both = _rows(one), _rows(other)
        found = [_difference(name, *both, _numbers(one)) for name in known if variables is None or name in variables]
    differences = [said for said in found if said]
    if differences:
        count = "1 variable" if len(differences) == 1 else f"{len(differences)} variables"
        raise AssertionError(f"the runs differ in {count}; first in {differences[0]}")


@contextlib.contextmanager
def _opened(results: Results) -> Iterator[xr.DataTree]:
    """The tree of some results. A file that is named is closed again."""
    if isinstance(results, str | Path):
        with open_archive(results) as tree:
            yield tree
    elif isinstance(results, xr.DataTree):
        yield results
    else:
        raise OptionError(
            f"results are a {type(results).__name__}; expected what tc.run or tc.open_archive returns, or an archive's path"
        )


def _rows(tree: xr.DataTree) -> Rows:
    """The variables of realizations that are kept."""
    groups = [tree.to_dataset(), *(tree.children[name].to_dataset() for name in ("sample",) if name in tree.children)]
    return {str(name): values for group in groups for name, values in group.data_vars.items()}


def _numbers(tree: xr.DataTree) -> np.ndarray:
    """Numbers (realization,) of the realizations."""
    return np.asarray(tree.to_dataset()[terms.REALIZATION].values)


def _meaning(status: int) -> str:
    known = dict(enumerate(terms.STATUS_MEANINGS)) | {terms.UNFINISHED: "unfinished"}
    return known.get(int(status), f"status {status}")


def _some(numbers: np.ndarray) -> str:
    """How many realizations there are, and the first of them."""
    first = ", ".join(map(str, numbers[:FIRST]))
    return f"{len(numbers)} (realization {first}{', ...' if len(numbers) > FIRST else ''})"


def _holds_its_points(rows: Rows) -> np.ndarray:
    """Of which realizations (realization,) the archive holds the contact points that `gap_min` is of."""
    held = rows[terms.STATUS.name].values != terms.UNFINISHED
    if terms.SEARCHED.name in rows:
        held &= rows[terms.SEARCHED.name].values != 1
    return np.asarray(held)


def _least_gaps(pair: ArchivedPair, rows: Rows, some: slice) -> np.ndarray:
    """The least gaps (realization, state) [mm] of some realizations."""
    try:
        return np.asarray(pair.gaps(rows, some).min(axis=-1))
    except NotKeptError as error:
        raise AssertionError(
            f'gaps cannot be computed again without {error}, which was not kept: tc.run(..., keep="all")'
        ) from error


def _difference(name: str, one: Rows, other: Rows, numbers: np.ndarray) -> str:
    """Where two runs differ in a variable, or nothing."""
    if name not in one or name not in other:
        return "" if (name in one) == (name in other) else f'"{name}", which only one of them keeps'
    x, y = one[name].values, other[name].values
    if x.shape != y.shape:
        return f'"{name}", whose shapes are {x.shape} and {y.shape}'
    differs = (x != y) & ~(np.isnan(x) & np.isnan(y))
    if not differs.any():
        return ""
    row, *rest = map(int, np.argwhere(differs)[0])
    labels = one[name].coords
    place = [f"{dim} {labels[dim].values[k] if dim in labels else k}" for dim, k in zip(one[name].dims[1:], rest, strict=True)]
    count = differs.reshape(len(differs), -1).any(axis=1).sum()
    where = ", ".join([f"realization {numbers[row]}", *place])
    return f'"{name}", {where}: {x[row, *rest]:.17g} and {y[row, *rest]:.17g} ({count} of {len(x)} realizations differ)'
