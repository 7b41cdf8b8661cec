"""The contributors of each measurement, from the draws of the run itself: linear shares of variance, with contact."""

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.errors import TolcontactError
from tolcontact.realizations import declaration_of
from tolcontact.report.table import NO_INTERVAL, grouped, percent
from tolcontact.statistics.variance_shares import (
    MIN_EFFECTIVE,
    MIN_R2,
    MIN_RESIDUALS,
    LinearShares,
    joined_columns,
    linear_shares,
    required_realizations,
)

MAX_REALIZATIONS = 20_000  # for the estimate of shares; more would not change the displayed digits
ROUNDED = 5e-5  # of the variance: less is not displayed
MAX_CONTRIBUTORS = 1000  # above this, a regression would take too long


class ContributorShares(NamedTuple):
    """The shares of the contributors of one measurement, the largest first, with a note.

    groups   contributors, or features with all their freedoms, joined if they are drawn jointly
    shares   (group, interval) of the variance; empty if none are shown
    note     a sentence: R^2, or the reason why no shares are shown
    title    what they are shares of
    is_open  whether no shares are shown because the realizations do not suffice
    """

    groups: list[str]
    shares: np.ndarray
    note: str
    title: str = "Contributors, with contact"
    is_open: bool = False


def shares_or_first_order(
    results: xr.DataTree, realizations: int, variances: Callable[[], np.ndarray] | None
) -> list[ContributorShares]:
    """Return the shares for each measurement; where realizations do not suffice, first-order ones from `variances`, if given.

    It returns the variance (measure, contributor) that each contributor causes to first order, without contact. These add up
    for independent contributors, so there are none with correlations or populations.
    """
    estimated, document = contributor_shares(results, realizations), declaration_of(results)
    is_joint = document.get("correlations") or document.get("populations")
    if variances is None or is_joint or not any(shares.is_open for shares in estimated):
        return estimated
    try:
        rows = variances()
    except TolcontactError:  # the model cannot be rebuilt
        return estimated
    pairs = zip(estimated, rows, strict=True)
    return [_first_order(results, row, shares) if shares.is_open else shares for shares, row in pairs]


def _first_order(results: xr.DataTree, variances: np.ndarray, instead: ContributorShares) -> ContributorShares:
    """Return shares of variances (contributor,), or what is shown instead where they are not known."""
    total = variances.sum()
    if not 0 < total < np.inf:
        return instead
    columns = np.flatnonzero(variances > 0)
    members = _groups(results, results["sample"].to_dataset(), columns)
    shares = np.full((len(members), len(terms.ESTIMATE)), np.nan)
    shares[:, 0] = [variances[columns[group]].sum() / total for group in members.values()]
    order, names = np.argsort(-shares[:, 0], kind="stable"), list(members)
    note = f"{instead.note} These are first-order shares, by sensitivities of the nominal assembly, without contact."
    return ContributorShares([names[k] for k in order], shares[order], note, "Contributors, first order, without contact")


def contributor_shares(results: xr.DataTree, realizations: int) -> list[ContributorShares]:
    """Return the shares for each measurement of a run with this number of finished realizations."""
    names = results.to_dataset()[terms.MEASURE].values
    sample = results["sample"].to_dataset()
    if terms.DEVIATION.name not in sample:
        return [_without("The archive has no deviations of contributors (run with --keep all).", is_open=True)] * len(names)
    selection = {terms.REALIZATION: slice(min(realizations, MAX_REALIZATIONS))}
    x = sample[terms.DEVIATION.name].isel(selection).values
    columns = np.flatnonzero(np.ptp(x, axis=0) > 0)
    if not columns.size:
        return [_without("No contributor varies.")] * len(names)
    required = required_realizations(len(columns))
    if len(x) < required or len(columns) > MAX_CONTRIBUTORS:
        reason = f"Shares of {grouped(len(columns))} contributors cannot be estimated from {grouped(len(x))} realizations"
        advice = f"at least {grouped(required)} are needed" if len(x) < required else "use tolcontact contributions"
        return [_without(f"{reason}; {advice}.", is_open=True)] * len(names)
    members = _groups(results, sample, columns)
    y = results.to_dataset()[terms.MEASURED.name].isel(selection).values[:, terms.CORRECTED]
    shares = linear_shares(x[:, columns], y, list(members.values()))
    return [_shown(list(members), of_measure, len(x)) for of_measure in shares]


def _shown(names: list[str], shares: LinearShares | None, count: int) -> ContributorShares:
    if shares is None:
        return _without("The measurement does not vary, or is not a number.")
    r2 = percent(np.maximum(shares.r2, 0.0)).removesuffix(f" {NO_INTERVAL}")  # adjusted, so it may be negative
    if not shares.r2[0] >= MIN_R2:
        return _without(
            f"A linear model explains only {r2} of the variance with contact, so linear shares would mislead; "
            "tolcontact contributions finds the shares of nonlinear measurements."
        )
    order = np.argsort(-shares.shares[:, 0], kind="stable")
    note = (
        f"Shares of the variance with contact, by linear regression on {grouped(count)} realizations, which explains {r2}; "
        "the rest is due to contact and other nonlinearities."
    )
    if np.isnan(shares.shares[:, 1]).any():
        note += f" A share needs {MIN_EFFECTIVE} realizations behind the variance of its contributors."
    if np.isnan(shares.r2[1]) and not shares.r2[0] > 1 - ROUNDED:
        note += f" An interval of it needs {MIN_RESIDUALS} realizations, and residuals without heavy tails."
    return ContributorShares([names[k] for k in order], shares.shares[order], note)


def _without(note: str, *, is_open: bool = False) -> ContributorShares:
    return ContributorShares([], np.zeros((0, len(terms.ESTIMATE))), note, is_open=is_open)


def _groups(results: xr.DataTree, sample: xr.Dataset, columns: np.ndarray) -> dict[str, np.ndarray]:
    """Return the positions in `columns` of each group, by name."""
    labels = [str(label) for label in sample[terms.CONTRIBUTOR].values]
    owners = [_owner(label, source) for label, source in zip(labels, sample[terms.CONTRIBUTOR_SOURCE.name].values, strict=True)]
    numbers = {label: column for column, label in enumerate(labels)}
    sets = [[numbers[label] for label in together if label in numbers] for together in _drawn_together(results)]
    groups = joined_columns(owners, [joined for joined in sets if joined], columns)
    return {name: np.searchsorted(columns, group) for name, group in groups.items()}


def _owner(label: str, source: str) -> str:
    """Return the owner of a contributor: a feature, its form, a datum that touches form, or the contributor itself."""
    if source == "datum" and ": " in label:  # its form belongs to another feature
        return label.rpartition(": ")[0]
    ends = {"feature": ".", "datum": ".", "form": " "}  # before the freedom of a feature, and the number of a mode of its form
    return label.rpartition(ends[source])[0] if source in ends else label


def _drawn_together(results: xr.DataTree) -> Iterator[list[str]]:
    """Yield labels of contributors that the model declares to depend on each other."""
    document = declaration_of(results)
    for correlation in document.get("correlations", []):
        yield list(correlation["labels"])
    for variable in document.get("variables", []):
        yield [variable["name"], *variable["drives"]]
    for population in document.get("populations", []):
        yield list(population["columns"] or population["values"])
