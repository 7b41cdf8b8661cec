"""Elastic parts in reports: the reactions at their locators, welds and contact points, and what bending adds to variances."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.arrays import Array, Float
from tolcontact.errors import TolcontactError
from tolcontact.realizations import is_assembled
from tolcontact.report.table import Table, number, percent
from tolcontact.statistics.intervals import mean, proportion, standard_deviation, variance_ratio

MAX_ROWS = 10_000  # realizations whose reactions are shown
NO_LOAD, ROUNDING = 1e-4, 1e-9  # of the largest reaction of all: contact that transmits less is open; smaller ones are zero


class RigidMeasured(Protocol):
    """Values with rigid parts (realization, measure), and how these are placed in words."""

    @property
    def measured(self) -> Float[Array, "realization measure"]: ...

    @property
    def words(self) -> str: ...


@dataclass(frozen=True, eq=False)
class Reaction:
    """The reactions of a pair at one contact point, or at all of them, in a run.

    at, along   the contact point [mm] and the direction of the force on the moving part, both nominal
    values      (realization,) [N]; negative ones pull
    is_contact  whether it is contact, which may be open
    """

    name: str
    pair: str
    at: Float[Array, " 3"]
    along: Float[Array, " 3"]
    values: Float[Array, " realization"]
    is_contact: bool


def reactions_of(results: xr.DataTree) -> list[Reaction]:
    """Return the reaction of each load between elastic parts; none if the run did not keep reactions or has no such parts."""
    if terms.ELASTIC_GROUP not in results.children:
        return []
    group, contact = results[terms.ELASTIC_GROUP].to_dataset(), results["contact"].to_dataset()
    if terms.LOAD.name not in group or terms.MOVING_POINT.name not in contact:
        return []
    rows = results.to_dataset().isel({terms.REALIZATION: slice(MAX_ROWS)})
    loads = group[terms.LOAD.name].values[:MAX_ROWS][is_assembled(rows[terms.STATUS.name].values)]
    points, holds = group[terms.POINT_OF_LOAD.name].values, group[terms.HOLDS.name].values
    pairs = contact[terms.PAIR_OF_POINT.name].values[points]
    at, along = (contact[variable.name].values[points] for variable in (terms.MOVING_POINT, terms.REFERENCE_NORMAL))
    names, counts = rows[terms.PAIR].values, np.bincount(pairs, minlength=rows.sizes[terms.PAIR])
    locators, locator_of_point = results["sample"].to_dataset()[terms.LOCATOR].values, contact.get(terms.LOCATOR_OF_POINT.name)
    supports = np.full(len(points), -1) if locator_of_point is None else locator_of_point.values[points]
    reactions = []
    for k, pair in enumerate(pairs):
        place = "" if counts[pair] == 1 else f" {k - int(np.argmax(pairs == pair)) + 1}"
        label = str(locators[supports[k]]) if supports[k] >= 0 else f"{names[pair]}{place}"
        reactions.append(Reaction(label, str(names[pair]), at[k], along[k], loads[:, k], not holds[k]))
    return reactions


def elastic_tables(results: xr.DataTree, rigid: Callable[[], RigidMeasured | None] | None) -> Iterator[Table]:
    """Yield the tables of elastic parts; `rigid` returns values with rigid parts (see variance_table)."""
    if reactions := reactions_of(results):
        yield reaction_table(reactions)
        if rigid is not None and (table := variance_table(results, rigid)) is not None:
            yield table


def reaction_table(reactions: list[Reaction]) -> Table:
    """Return mean, spread and extremes of the reactions of each locator and weld, and of each contact pair in sum."""
    largest = max(float(np.abs(reaction.values).max(initial=0)) for reaction in reactions)
    rows = []
    for reaction in sorted(_in_sum(reactions), key=lambda reaction: -float((reaction.values**2).sum())):
        values = np.where(np.abs(reaction.values) <= ROUNDING * largest, 0.0, reaction.values)
        open_share = percent(proportion(np.abs(values) <= NO_LOAD * largest)) if reaction.is_contact else ""
        place, along = (", ".join(f"{x + 0.0:.4g}" for x in vector.round(9)) for vector in (reaction.at, reaction.along))
        figures = [mean(values), standard_deviation(values, times=6.0)] if values.any() else []
        ends = (values.min(), values.max()) if len(values) else (np.nan, np.nan)
        texts = [*(map(number, figures) if figures else ("0", "0")), *(f"{x:.4g}" for x in ends)]
        rows.append([reaction.name, place, along, *texts, open_share])
    columns = ["reaction", "at [mm]", "along", "mean [N]", "6 sigma [N]", "smallest [N]", "largest [N]", "open"]
    remarks = [
        f"Forces on the moving part of each pair, along the stated direction, of {len(reactions[0].values)} realizations, the "
        "largest first; negative ones pull. Contact of more points than one is summed up, and stands at its centre.",
        "In the picture of the assembly, arrows are as long as means, and bars reach from the 2.5th to the 97.5th percentile.",
    ]
    return Table("Reactions of elastic parts", columns, rows, remarks)


def _in_sum(reactions: list[Reaction]) -> Iterator[Reaction]:
    """Yield reactions of locators and welds, and one in sum for each pair of faces."""
    by_pair = dict[str, list[Reaction]]()
    for reaction in reactions:
        is_of_faces = reaction.is_contact and reaction.name.startswith(reaction.pair)
        by_pair.setdefault(reaction.pair if is_of_faces else reaction.name, []).append(reaction)
    for name, members in by_pair.items():
        if len(members) == 1:
            yield members[0]
        else:
            at, along = (np.mean([getattr(member, entry) for member in members], axis=0) for entry in ("at", "along"))
            values = np.sum([member.values for member in members], axis=0)
            yield Reaction(name, members[0].pair, at, along, values, is_contact=True)


def variance_table(results: xr.DataTree, rigid: Callable[[], RigidMeasured | None]) -> Table | None:
    """Return the share of each variance that elasticity adds: 1 - Var(rigid) / Var(elastic), from the same realizations.

    `rigid` returns the first values with rigid parts, or None. There is no table if the model cannot be rebuilt.
    """
    try:
        values = rigid()
    except TolcontactError:
        values = None
    if values is None:
        return None
    rows = results.to_dataset().isel({terms.REALIZATION: slice(len(values.measured))})
    is_kept = is_assembled(rows[terms.STATUS.name].values) & np.isfinite(values.measured).all(axis=1)
    measured = rows[terms.MEASURED.name].values[is_kept, terms.CORRECTED]
    table = []
    for k, measure in enumerate(rows[terms.MEASURE].values):
        ratio = variance_ratio(values.measured[is_kept, k], measured[:, k])
        table.append([str(measure), percent((1 - ratio.value, 1 - ratio.upper, 1 - ratio.lower))])
    remark = (
        f"1 - V / W: W is the variance with contact, V that of {values.words}; {int(is_kept.sum())} realizations. "
        "Negative: bending evens deviations out."
    )
    return Table("Variance that elasticity adds", ["measurement", "share of variance"], table, [remark])
