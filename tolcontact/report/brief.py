"""What is printed in brief: the measurements that fall short, of many; coarse answers of analyses."""

from collections.abc import Iterator, Sequence

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.report.analysis_tables import analysis_report
from tolcontact.report.results_table import verdict_of
from tolcontact.statistics.capability import CONSTANT, FAILS, MEETS, UNDECIDED

BRIEF_TABLES, BRIEF_ROWS = 10, 4  # of a coarse answer in brief: the first tables, and the rows of each that a line has
MOST_DETAILED, MOST_LISTED = 3, 6  # measurements with all their figures; measurements, parts or pairs in a table
EVERYTHING = "the page has all, and so has tolcontact summary --all"
URGENCY = {FAILS: 2.0, UNDECIDED: 1.0, "": 0.0, CONSTANT: -1.0, MEETS: -1.0}


def brief_measures(summary: xr.Dataset) -> tuple[xr.Dataset, str]:
    """Return the summary of the measurements that fall short of their limits, and a remark about all others.

    All measurements are kept if there are few. One that is not a number in some realizations falls short. If none does, the
    first ones are kept.
    """
    count = summary.sizes[terms.MEASURE]
    if count <= MOST_LISTED:
        return summary, ""
    measures = [summary.isel(measure=index) for index in range(count)]
    opinions = [verdict_of(measure, summary.attrs["realizations"]) for measure in measures]
    verdicts = [
        FAILS if int(measure[terms.NOT_A_NUMBER].values) else "" if opinion is None else opinion.word
        for measure, opinion in zip(measures, opinions, strict=True)
    ]
    shares = [float(m["statistic_value"].sel(state=terms.STATES[1], statistic=terms.OUTSIDE)[0]) for m in measures]
    urgencies = [URGENCY[verdict] + float(np.nan_to_num(share)) / 2 for verdict, share in zip(verdicts, shares, strict=True)]
    failing = [index for index in _largest(urgencies, MOST_LISTED) if verdicts[index] in (FAILS, UNDECIDED)]
    selection = failing or list(range(MOST_LISTED))
    remainder = [verdict for index, verdict in enumerate(verdicts) if index not in selection]
    phrases = {
        "fall short, too": (FAILS,),
        "undecided": (UNDECIDED,),
        "without limits": ("",),
        "meet their limits": (MEETS, CONSTANT),
    }
    counts = {phrase: sum(verdict in group for verdict in remainder) for phrase, group in phrases.items()}
    remark = ", ".join(f"{number} more {phrase}" for phrase, number in counts.items() if number)
    return summary.isel(measure=selection), f"{remark}; {EVERYTHING}"


def _largest(weights: Sequence[float] | np.ndarray, count: int) -> list[int]:
    """Return the indices of the largest weights in ascending order."""
    return sorted(np.argsort(-np.asarray(weights, dtype=float), kind="stable")[:count].tolist())


def brief_lines(record: terms.AnalysisRecord, dataset: xr.Dataset) -> Iterator[str]:
    """Yield a coarse answer in brief: what it rests on, and the first rows of its first tables."""
    report = analysis_report(record, dataset)
    yield f"{report.name.lower()} {dataset.attrs[terms.COARSE]}"
    tables = [table for table in report.tables if len(table.columns) > report.main and (table.title or len(report.tables) == 1)]
    for table in tables[:BRIEF_TABLES]:
        rows = [[cell for cell in (row[0], row[report.main], *row[1:]) if cell != "-"][:2] for row in table.rows[:BRIEF_ROWS]]
        known = "; ".join(" ".join(row) for row in rows if len(row) > 1)
        yield f"  {table.title}: " * bool(table.title) + (known or "not known yet")
