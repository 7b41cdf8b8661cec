"""The contact of a run in words: status, penetration, the convention of its objective, offsets of parts, and reactions."""

import math
from collections.abc import Iterator

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.table import Table, by_measure, grouped, number, percent, settled
from tolcontact.statistics.contact import ACCURACY

RAW, CORRECTED = terms.STATES
MOST_CLASHES = 2  # pairs of parts that lie in each other, in a long summary
DEEPEST = "largest penetration between surfaces"
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
    lines = [line for measure in by_measure(summary) for line in _other_results(measure)]
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
        here = measure["statistic_value"].sel(state=CORRECTED, statistic=statistic).values
        texts = []
        for name in measure[terms.BY_OBJECTIVE].values:
            change = measure["change_by_objective"].sel(by_objective=name, change_of=change_of).values
            is_mean = statistic == terms.MEAN  # the change of a spread is a factor
            joined = _sum(here, change) if is_mean else np.exp(_sum(np.log(here), np.log(change)))
            if _is_beyond(joined[0], here) and _is_beyond(0 if is_mean else 1, change):
                texts.append(f'{number(joined)} by "{name}"')
        if texts:
            yield f"{measure[terms.MEASURE].values}: {statistic} {', '.join(texts)}; here {number(here).partition(' [')[0]}"


def _is_beyond(value: float, estimate: np.ndarray) -> bool:
    """Return whether a value lies outside of the interval of an estimate (value, lower, upper), if it has one."""
    return bool(value < estimate[1] or value > estimate[2])


def _sum(estimate: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Return the sum (value, lower, upper) of an estimate and its change, whose errors are independent."""
    value = estimate[0] + change[0]
    lower, upper = np.hypot(estimate[0] - estimate[1:], change[0] - change[1:])
    return np.array([value, value - lower, value + upper])


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


def pair_table(summary: xr.Dataset) -> Table | None:
    """Return the share of realizations with contact, and the reaction, of each pair; None without pairs."""
    rows = []
    for pair in summary["pair"].values:
        mean, *_, high = summary["reaction"].sel(pair=pair).values
        rows.append([str(pair), percent(summary["carried"].sel(pair=pair).values), number(mean), number(high)])
    heading = terms.reaction_words(summary["reaction"].attrs["units"]).heading
    return Table("", ["contact pair", terms.IN_CONTACT, heading, "95th\npercentile"], rows) if rows else None


def contact_lines(summary: xr.Dataset, count: int, *, is_long: bool = False) -> Iterator[str]:
    """Yield lines about the contact of a run of `count` realizations; only what failed, if it is part of a long summary."""
    if not is_long:
        yield f"realizations touched by contact: {percent(summary['touched'].values)}"
    statuses = zip(summary["status_meaning"].values, summary["by_status"].values.tolist(), strict=True)
    by_status, resolution = {str(meaning): int(n) for meaning, n in statuses}, summary.attrs["resolution"]
    yield "status: " + ", ".join(f"{n} {meaning}" for meaning, n in by_status.items() if n)
    conflicts = [f"{pair} ({int(n)})" for pair, n in zip(summary["pair"].values, summary["conflicts"].values, strict=True) if n]
    if conflicts and is_long:
        yield f"not assemblable, so out of specification, and left out of other statistics: {', '.join(conflicts)}"
    elif conflicts:
        share = percent(summary["not_assemblable"].values)
        yield f"not assemblable: {share}; these count as out of specification, and other statistics with contact leave them out"
        yield f"pairs in conflict there: {', '.join(conflicts)}"
    if unconverged := by_status["not_converged"]:
        yield f"not converged: {unconverged} of {count}; the statistics include their last poses"
    if doubtful := by_status["doubtful"]:
        yield from _doubts(summary, doubtful, count)
    yield from _clashes(summary, count, is_long=is_long)
    raw, corrected = (settled(float(summary["penetration"].sel(state=state))) for state in (RAW, CORRECTED))
    median, largest = summary["iterations"].values
    steps = f", {median:g} steps (median), {largest:g} at most" if resolution == "exact" and not is_long else ""
    yield f"resolution: {resolution}{steps}; objective: {summary.attrs['objective']}"
    checks = [*_between(summary, count), *_advice(summary, corrected, unconverged)]
    if is_long:
        yield from (line for line in checks if not line.startswith(DEEPEST))
        yield from offset_lines(summary)
        if len(lines := [*convention_lines(summary)]) > 3:  # results depend on it
            yield from lines
        return
    yield from convention_lines(summary)
    yield from offset_lines(summary)
    if shifted := summary.attrs["datum_shifts"]:
        yield f"datum shift of {shifted}: not drawn; contact of the datum features determines it"
    if elastic := summary.attrs["elastic_parts"]:
        yield f"elastic parts: {elastic}; certificates hold at their contact points, bent"
    if stored := summary.attrs["stored_coordinates"]:
        yield stored
    yield from summary.attrs["correlations"].splitlines()
    yield f"largest penetration at contact points: {raw:.3g} mm without, {corrected:.3g} mm with contact"
    yield from checks


def _doubts(summary: xr.Dataset, doubtful: int, count: int) -> Iterator[str]:
    in_bodies = min(int(summary["clash_count"].values[summary["clash_declared"].values == 1].sum()), doubtful)
    number_far = f"{doubtful - in_bodies} of {count}"
    if in_bodies < doubtful and summary["clash_share"].values[0] > 0:  # whose pairs are named instead of declared ones
        yield (
            f"doubtful: {number_far}: parts of a contact pair lie in each other beyond its faces, or too far from their poses "
            "without contact; tolcontact check names these faces"
        )
    elif in_bodies < doubtful:
        yield f"doubtful: {number_far} answers lie too far from the pose without contact to be certified"
    if in_bodies:
        parts = ", ".join(_clashes_of(summary, is_declared=True))
        yield f"doubtful: in {in_bodies} of {count} answers bodies with declared contact still lie in each other: {parts}"
        yield (
            "advice: they probably meet beyond the chosen faces; tolcontact check names these, and writes the lines to add, "
            "if it sees them among its 128 realizations"
        )


def _clashes(summary: xr.Dataset, count: int, *, is_long: bool = False) -> Iterator[str]:
    """Yield lines about bodies without contact that penetrate each other, and about the test of all bodies."""
    watched, share = int(summary["watched"]), summary["clash_share"].values
    if not watched:
        is_linear = summary.attrs["resolution"] == "linearized"
        reason = "by a linearized resolution" if is_linear else "in this archive"
        yield f"bodies were not tested for interference {reason}: certificates hold for contact points"
        return
    if share[0] > 0:
        clashes = _clashes_of(summary, is_declared=False)
        if is_long:  # the verdicts state the share
            rest = [f"{len(clashes) - MOST_CLASHES} more"] if len(clashes) > MOST_CLASHES else []
            yield f"parts without declared contact lie in each other: {', '.join(clashes[:MOST_CLASHES] + rest)}"
        else:
            text = f"{percent(share)} of realizations; verdicts do not hold there"
            yield f"parts without declared contact lie in each other: {text}"
            yield f"these parts, where they lie deepest: {', '.join(clashes)}"
        yield "advice: declare their contact, or that it is meant: assembly.may_overlap(...); tolcontact check writes the lines"
    if is_long:
        return
    extent = f"all {grouped(watched)}" if watched == count else f"{grouped(watched)} of {grouped(count)}"
    depth = summary.attrs["interference_depth"]
    found = "see above" if share[0] > 0 else "none where certified"
    yield f"interference of bodies from {depth:.2g} mm: {found} ({extent} tested)"
    if summary.attrs["not_watched"]:
        yield f"not tested for interference: {summary.attrs['not_watched']}"


def _clashes_of(summary: xr.Dataset, *, is_declared: bool) -> list[str]:
    """Return the pairs of parts that penetrate each other, with the number of realizations and the largest depth."""
    columns = [summary[name].values for name in ("clash", "clash_count", "clash_largest_depth", "clash_declared")]
    return [
        f"{name} ({grouped(int(count))}{f', up to {depth:.2g} mm' if math.isfinite(depth) else ''})"
        for name, count, depth, declared in zip(*columns, strict=True)
        if bool(declared) == is_declared
    ]


def _between(summary: xr.Dataset, count: int) -> Iterator[str]:
    """Yield lines about penetration between contact points, and about contact beyond the ends of faces."""
    checked, depth, overhang = (float(summary[name]) for name in ("surfaces_checked", "surface_penetration", "beside"))
    limit = terms.NOTICED_SHARE * summary.attrs["smallest_range"]
    if math.isfinite(depth):
        yield f"{DEEPEST}: {settled(depth):.3g} mm ({checked:.0f} of {count} checked)"
        if depth > limit:
            share = percent(summary["penetrating_share"].values)
            least = f"{terms.NOTICED_SHARE:.0%} of the smallest tolerance"
            yield f"penetration between surfaces above {least}: {share} of realizations"
        if depth > limit and depth > 2 * float(summary["penetration"].sel(state=CORRECTED)):
            yield f"advice: {_way_out(summary)}"
        if overhang > limit:
            yield f"touching contact points lie up to {overhang:.3g} mm outside their reference face"
    contacts, ended = (float(summary[name]) for name in ("contacts", "contacts_ended"))
    if ended > 0:
        yield f"contact beyond the end of a face: {ended:.0f} of {contacts:.0f} touching contact points, where checked"
    for pair, depth in zip(summary["pair"].values, summary["false_contact"].values, strict=True):
        if depth > limit:
            share = percent(summary["false_contact_share"].values)
            yield f'contact pair "{pair}": points lie up to {depth:.3g} mm inside where its surfaces are apart ({share})'
            yield f"advice: its faces end within reach of contact; {_way_out(summary)}"


def _way_out(summary: xr.Dataset) -> str:
    """Return advice for surfaces that penetrate each other, or were resolved although they were apart."""
    if summary.attrs["resolution"] == "linearized":
        return "use --resolution exact"
    if summary.attrs["search"] == "bounded":
        return "use finer meshes, or where faces have form a smaller spacing"
    return f'leave out search="{summary.attrs["search"]}"'


def _advice(summary: xr.Dataset, penetration: float, unconverged: int) -> Iterator[str]:
    """Yield advice on penetration that remains after a linear step, or with the paper's set of active points."""
    penetrates = penetration > terms.NOTICED_SHARE * summary.attrs["smallest_range"]
    if penetrates and summary.attrs["active_set"] == "initial":
        yield 'advice: points outside the initial set penetrate; use Method(active_set="closed")'
    elif summary.attrs["resolution"] == "linearized" and penetrates:
        yield f"advice: penetration exceeds {terms.NOTICED_SHARE:.0%} of the smallest tolerance; use --resolution exact"
    elif summary.attrs["resolution"] == "linearized" and unconverged:
        yield "advice: some realizations did not converge; use --resolution exact"
