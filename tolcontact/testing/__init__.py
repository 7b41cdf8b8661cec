"""Assertions for tests of your own models: resolved realizations, no clashes, correct archived gaps, identical runs.

`results` is the tree that `tc.run` or `tc.open_archive` returns, or the path of an archive.

    import tolcontact as tc
    from tolcontact.testing import assert_gaps_recompute, assert_no_clashes, assert_resolved, assert_same_run

    def test_my_assembly():
        results = tc.run("models/ra1.py", samples=200, seed=1)
        assert_resolved(results)
        assert_no_clashes(results)
        assert_gaps_recompute(results)
        assert_same_run(results, "expected.nc")
"""

from collections.abc import Sequence
from dataclasses import fields
from pathlib import Path

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.archive import model_of, opened
from tolcontact.discretization import ContactPoints
from tolcontact.errors import OptionError
from tolcontact.geometry.meeting import Meeting
from tolcontact.method import Method
from tolcontact.testing.archived_faces import tangents
from tolcontact.testing.referee import ArchivedPair, Rows
from tolcontact.workflow import build

__all__ = ["assert_datums_recompute", "assert_gaps_recompute", "assert_no_clashes", "assert_resolved", "assert_same_run"]

Results = xr.DataTree | str | Path
NAMED_REALIZATIONS = 5  # in a message
MAX_GAPS = 500_000  # per pass


def assert_resolved(results: Results) -> None:
    """Assert that every realization of `results` has a certificate: its status is `untouched` or `resolved`.

    `tc.testing.assert_resolved("run.nc")`, or the results of tc.run.

    Raises AssertionError with the number of all other realizations, by status, and the first of each status.
    """
    with opened(results) as tree:
        status, numbers = _rows(tree)[terms.STATUS.name].values, _numbers(tree)
    unresolved = ~np.isin(status, terms.CERTIFIED)
    if unresolved.any():
        meanings = dict(enumerate(terms.STATUS_MEANINGS))
        codes = np.unique(status[unresolved])
        by_status = [f"{meanings.get(int(k), f'status {k}')} {_listed(numbers[status == k])}" for k in codes]
        raise AssertionError(f"{unresolved.sum()} of {status.size} realizations are not resolved: {', '.join(by_status)}")


def assert_no_clashes(results: Results) -> None:
    """Assert that all bodies were tested in every realization, and none without declared contact penetrate each other.

    `tc.testing.assert_no_clashes(results)`
    Raises AssertionError with the number of realizations with clashes, or without a test, and the first of them.
    """
    with opened(results) as tree:
        rows, numbers = _rows(tree), _numbers(tree)
        clashes, names = rows[terms.CLASHES.name].values, [str(name) for name in tree.to_dataset()[terms.PART].values]
        parts = [rows[variable.name].values for variable in (terms.CLASH_PART, terms.CLASH_OTHER)]
    if (clashes < 0).any():
        raise AssertionError(f"bodies were not tested in {_listed(numbers[clashes < 0])} realizations; resolve them exactly")
    if (clashes > 0).any():
        first, second = (names[index[clashes > 0][0]] for index in parts)
        listed = _listed(numbers[clashes > 0])
        raise AssertionError(f'parts lie in each other in {listed} realizations, first "{first}" and "{second}"')


def assert_gaps_recompute(results: Results, *, within: float = terms.ROUNDED) -> None:
    """Assert that the archived points, poses and deviations give the least gaps `gap_min` (realization, state, pair) [mm].

    `tc.testing.assert_gaps_recompute(results)`

    A referee recomputes the gaps from the archive alone: n'(x_m - x_r), with x = R p + t, p a nominal contact point of the
    moving or the reference part, and n the nominal normal rotated with the reference part; the deviation of the unilateral
    locator that a point represents is subtracted. The gap between a ball or a shaft and a wall is their distance, from their
    sizes and positions. Faces of features are first displaced in their parts, then offset outwards by their sizes and form
    deviations. Gaps between elastic parts are larger by their opening under constant forces, and by their flexibility times the
    archived loads. The two results may differ by `within` [mm], by default 1e-9.

    Where faces end (pairs that the archive calls `bounded`), contact is searched again at the archived poses, between archived
    bodies. This is the simulation's own search, so it detects inconsistent poses and gaps, not an error of the search itself;
    `studies/certificates` checks the search by exact distances.

    Unfinished realizations are skipped, and so are realizations whose `searched` is 1: their contact points were projected
    again, and are not archived.

    Raises AssertionError with the largest difference and its location; also if the archive does not contain the poses (or, for
    unilateral locators, the deviations).
    """
    with opened(results) as tree:
        rows, numbers = _rows(tree), _numbers(tree)
        archived = rows[terms.GAP_MIN.name]
        comparable = np.asarray(rows[terms.SEARCHED.name].values != 1)  # the archive holds the points that gaps refer to
        largest, place, meetings = 0.0, "", _meetings(tree)
        for number, name in enumerate(archived[terms.PAIR].values):
            pair = ArchivedPair(tree, number, *meetings.get(number, (None, None)))
            rows_of_pair = _rows_in_station(tree, rows, number)
            count = max(1, MAX_GAPS // len(pair.normal))
            for start in range(0, len(comparable), count):
                piece = slice(start, start + count)
                gaps, stored = pair.gaps(rows_of_pair, piece).min(axis=-1), archived[piece, :, number].values
                with np.errstate(invalid="ignore"):
                    errors = np.where(gaps == stored, 0.0, np.abs(gaps - stored))[comparable[piece]]
                errors[np.isnan(errors)] = np.inf
                if errors.max(initial=0.0) > largest:
                    largest = float(errors.max())
                    row, state = np.argwhere(errors == largest)[0]
                    place = (
                        f'realization {numbers[piece][comparable[piece]][row]}, {terms.STATES[state]}, contact pair "{name}"'
                    )
    if largest > within:
        raise AssertionError(
            f'"{terms.GAP_MIN.name}" is not the smallest gap of the archived contact points: it differs by {largest:.3g} mm in '
            f"{place}; {within:.3g} mm are allowed"
        )


def assert_datums_recompute(results: Results) -> None:
    """Assert that the archived tangent datum planes of features with form deviation are correct, and outside the material.

    `tc.testing.assert_datums_recompute(results)`
    A linear programme finds the plane with the least distance from the archived heights of each face, from the archive alone.
    Raises AssertionError with the first realization that has another plane, and if the archive has no deviations.
    """
    with opened(results) as tree:
        rows, planes = _rows(tree), tangents(tree)
        if planes and terms.DEVIATION.name not in rows:
            raise AssertionError(f'datums cannot be computed again without "{terms.DEVIATION.name}", which was not kept')
        for plane in planes:
            deviations = rows[terms.DEVIATION.name].values
            label = rows[terms.DEVIATION.name][terms.CONTRIBUTOR].values[plane.columns.max()]
            for row, fault in plane.faults(deviations):
                raise AssertionError(f'the plane of "{label}" in realization {_numbers(tree)[row]} {fault}')


def assert_same_run(a: Results, b: Results, *, variables: Sequence[str] | None = None) -> None:
    """Assert that runs `a` and `b` have the same values in every realization, to the last bit (NaN equals NaN).

    `tc.testing.assert_same_run("run.nc", "again.nc")`

    The comparison covers the labels, and all variables of realizations, or the named ones: "measured", "gap_min", ...
    Attributes, history, solver and displacement fields are not compared.

    Raises AssertionError with the number of variables that differ, and the first realization that differs in the first of them.
    """
    names = [variable.name for variable in (*terms.BY_REALIZATION, *terms.ELASTIC_ROWS)]
    if unknown := [name for name in variables or () if name not in names]:
        raise OptionError(f"no realization has {', '.join(map(repr, unknown))}; expected some of: {', '.join(names)}")
    with opened(a) as expected, opened(b) as actual:
        for dim in (terms.PART, terms.PAIR, terms.MEASURE):
            labels = [[str(label) for label in tree.coords[dim].values] for tree in (expected, actual)]
            if labels[0] != labels[1]:
                raise AssertionError(f"the labels of {dim} differ: {labels[0]} and {labels[1]}")
        sizes = [tree.sizes[terms.REALIZATION] for tree in (expected, actual)]
        if sizes[0] != sizes[1]:
            raise AssertionError(f"the runs have {sizes[0]} and {sizes[1]} realizations")
        rows = _rows(expected), _rows(actual)
        names += [name for name in {**rows[0], **rows[1]} if name.startswith(f"{terms.STATIONS_GROUP}/")]
        texts = [_difference(name, *rows, _numbers(expected)) for name in names if variables is None or name in variables]
    differences = [text for text in texts if text]
    if differences:
        count = "1 variable" if len(differences) == 1 else f"{len(differences)} variables"
        raise AssertionError(f"the runs differ in {count}; first in {differences[0]}")


def _rows(tree: xr.DataTree) -> Rows:
    """Return the archived variables of realizations; names in stations include the paths of their groups."""
    groups = [
        tree.to_dataset(),
        *(tree.children[name].to_dataset() for name in ("sample", terms.ELASTIC_GROUP) if name in tree.children),
    ]
    stations = tree.children[terms.STATIONS_GROUP].children.values() if terms.STATIONS_GROUP in tree.children else ()
    rows = {str(name): values for group in groups for name, values in group.data_vars.items()}
    return rows | {
        f"{group.path.lstrip('/')}/{name}": values
        for group in stations
        for name, values in group.to_dataset().data_vars.items()
    }


def _rows_in_station(tree: xr.DataTree, rows: Rows, pair: int) -> Rows:
    """Return the variables of realizations with the poses of the station where a pair may touch."""
    if terms.PAIR_STATION.name not in rows:
        return rows
    group = terms.station_group(str(rows[terms.PAIR_STATION.name].values[pair]))
    parts = tree.to_dataset()[terms.PART].values
    poses = {
        variable.name: rows[f"{group}/{stored.name}"].rename({terms.STATION_PART: terms.PART}).reindex({terms.PART: parts})
        for variable, stored in zip(terms.POSES, terms.STATION_POSES, strict=True)
        if f"{group}/{stored.name}" in rows
    }
    return {**rows, **poses}


def _numbers(tree: xr.DataTree) -> np.ndarray:
    """Return the numbers (realization,) of the realizations."""
    return np.asarray(tree.to_dataset()[terms.REALIZATION].values)


def _listed(numbers: np.ndarray) -> str:
    """Return the count of realizations, and the first of their numbers."""
    named = ", ".join(map(str, numbers[:NAMED_REALIZATIONS]))
    return f"{len(numbers)} (realization {named}{', ...' if len(numbers) > NAMED_REALIZATIONS else ''})"


def _meetings(tree: xr.DataTree) -> dict[int, tuple[Meeting, ContactPoints]]:
    """Return the meetings and contact points of pairs with bounded faces, from the archived model and method."""
    bounded = tree["contact"].to_dataset().get(terms.BOUNDED.name)
    if bounded is None or not bounded.values.any():
        return {}
    method = Method(**{choice.name: tree.attrs[choice.name] for choice in fields(Method)})
    program = build(model_of(tree), solver=tree.attrs["solver"], method=method)
    return {number: (meeting, program.nominal.pairs[number]) for number, meeting in program.meetings.items()}


def _difference(name: str, expected: Rows, actual: Rows, numbers: np.ndarray) -> str:
    """Return a text that states where two runs differ in a variable; an empty text if they do not."""
    if name not in expected or name not in actual:
        return "" if (name in expected) == (name in actual) else f'"{name}", which only one of them keeps'
    x, y = expected[name].values, actual[name].values
    if x.shape != y.shape:
        return f'"{name}", whose shapes are {x.shape} and {y.shape}'
    differs = (x != y) & ~(np.isnan(x) & np.isnan(y))
    if not differs.any():
        return ""
    row, *places = map(int, np.argwhere(differs)[0])
    dims, labels = expected[name].dims[1:], expected[name].coords
    place = [f"{dim} {labels[dim].values[k] if dim in labels else k}" for dim, k in zip(dims, places, strict=True)]
    count = differs.reshape(len(differs), -1).any(axis=1).sum()
    where = ", ".join([f"realization {numbers[row]}", *place])
    return f'"{name}", {where}: {x[row, *places]:.17g} and {y[row, *places]:.17g} ({count} of {len(x)} realizations differ)'
