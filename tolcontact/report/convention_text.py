"""What the choice of objective means for a run: the convention in words, results by other objectives, offsets of parts."""

from collections.abc import Iterator

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.figures import number, percent
from tolcontact.report.table import Table
from tolcontact.statistics.contact import ACCURACY

MAX_LINES = 8  # about figures that depend on the objective
NOTICED = 0.01  # share of realizations with offsets that nothing explains
CONVENTIONS = {  # what decides the pose of a part that contact moves
    "all points": "parts move as little as possible, measured at all contact points",
    "active points": "parts move as little as possible, measured where they penetrated",
    "locator stiffness": "locators hold parts like springs, and contact pushes them off",
    "seating": "forces press parts on their contacts; two-sided locators hold",
}


def convention_lines(summary: xr.Dataset) -> Iterator[str]:
    """Yield what the objective of the run assumes, and by how much results depend on it."""
    if standard := summary.attrs[terms.STANDARD]:
        yield f"standard of the drawings: {standard}"
    yield f"convention: {CONVENTIONS.get(summary.attrs['objective'], summary.attrs['objective'])}"
    counts = summary["compared_by_objective"].values
    if not summary.sizes[terms.BY_OBJECTIVE] or not counts.any():
        return
    lines = [line for name in summary[terms.MEASURE].values for line in _other_results(summary.sel(measure=name))]
    compared = f"on {counts[counts > 0].min()} of the same draws"
    if not lines:
        others = [f'"{name}"' for name in summary[terms.BY_OBJECTIVE].values]
        yield f"by {' or '.join(others)} results would be the same within their intervals, {compared}"
        return
    yield f"results depend on this convention: by others they would be, {compared},"
    yield from lines[:MAX_LINES]
    if len(lines) > MAX_LINES:
        yield f"and so on: {len(lines)} figures depend on it"
    yield 'advice: with a declared force (a weight, a clamp) and objective "seating" no convention decides'


def _other_results(measure: xr.Dataset) -> Iterator[str]:
    """Yield mean and 6 sigma of a measure under other objectives if they differ by more than sampling explains."""
    for statistic, change_of in ((terms.MEAN, terms.SHIFT), (terms.SIX_SIGMA, terms.SPREAD_RATIO)):
        own = measure["statistic_value"].sel(state=terms.STATES[1], statistic=statistic).values
        texts = []
        for name in measure[terms.BY_OBJECTIVE].values:
            change = measure["change_by_objective"].sel(by_objective=name, change_of=change_of).values
            joined, unchanged = (_sum(own, change), 0) if statistic == terms.MEAN else (_product(own, change), 1)
            if _is_beyond(joined[0], own) and _is_beyond(unchanged, change):
                texts.append(f'{number(joined)} by "{name}"')
        if texts:
            yield f"{measure[terms.MEASURE].values}: {statistic} {', '.join(texts)}; here {number(own).partition(' [')[0]}"


def _is_beyond(value: float, estimate: np.ndarray) -> bool:
    """Return whether a value lies outside of the interval of an estimate (value, lower, upper), if it has one."""
    return bool(value < estimate[1] or value > estimate[2])


def _sum(estimate: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Return the sum (value, lower, upper) of an estimate and its change, whose errors are independent."""
    value = estimate[0] + change[0]
    lower, upper = np.hypot(estimate[0] - estimate[1:], change[0] - change[1:])
    return np.array([value, value - lower, value + upper])


def _product(estimate: np.ndarray, ratio: np.ndarray) -> np.ndarray:
    """Return the product (value, lower, upper) of an estimate above 0 and its relative change."""
    return np.exp(_sum(np.log(estimate), np.log(ratio)))


def offset_table(summary: xr.Dataset) -> Table | None:
    """Return how far contact moved each part off its two-sided locators; None if it moved none."""
    rows = []
    for part in summary[terms.PART].values:
        offsets, beyond = summary["locator_offset"].sel(part=part).values, summary["offset_beyond"].sel(part=part).values
        if offsets[-1, 0] > ACCURACY:
            rows.append([str(part), *map(number, offsets), percent(beyond)])
    heading = ["moved off its\nlocators, mm", "median", "99 %", "further than they vary,\nshare of realizations"]
    return Table("", heading, rows) if rows else None


def unexplained_offsets(summary: xr.Dataset) -> list[str]:
    """Return the parts that contact moved further than their locators vary and bodies penetrated, with their shares."""
    shares = zip(summary[terms.PART].values, summary["offset_unexplained"].values, strict=True)
    return [f"{part} ({percent(share)})" for part, share in shares if share[0] > NOTICED]


def offset_lines(summary: xr.Dataset) -> Iterator[str]:
    """Yield a warning of parts that clearances and tolerances do not explain where they are."""
    if parts := unexplained_offsets(summary):
        yield (
            "contact moved parts off their locators by more than these vary and bodies penetrated, in this share of "
            f"certified realizations: {', '.join(parts)}"
        )
        yield "they were lifted or tilted until nothing penetrates; it does not show that they can be put together like that"
        yield (
            'advice: say what holds them: declare a force (weight, clamp, bolts) and objective "seating", with one-sided '
            "locators where they may lift; or the contact of their seat, if it is missing"
        )
