"""Groups of contributors: columns of deviations by contributor, feature or part."""

from collections.abc import Sequence

import numpy as np

from tolcontact.compilation import Program
from tolcontact.errors import OptionError
from tolcontact.features.freedoms import FORM
from tolcontact.statistics.linear_shares import joined_columns
from tolcontact.variation.draws import Draws
from tolcontact.vocabulary import GROUPED_BY


def owners(program: Program, by: str) -> list[str]:
    """Return the owner of each column of deviations: its contributor, feature or part; the modes of a form have one owner.

    Raises OptionError for a grouping that does not exist.
    """
    if by not in GROUPED_BY:
        raise OptionError(f"by is {by!r}; expected one of: {', '.join(GROUPED_BY)}")
    nominal, labels = program.nominal, list(program.nominal.contributors)
    if by == "contributor":
        contributors = zip(labels, program.draws.contributors, strict=True)
        return [label.rpartition(" ")[0] if contributor.source == FORM else label for label, contributor in contributors]
    # Locators belong to the part that they locate, even if `by` is "feature"; in a station to the part or joint there.
    owner_of = {label: part.located for part in nominal.parts for label in part.locators.labels}
    for pattern in nominal.patterns:
        part = pattern.declared.part.name
        labels_of_pattern = [freedom.label for freedom in pattern.freedoms]
        owner_of |= {label: part if by == "part" else label.rpartition(".")[0] for label in labels_of_pattern}
    return [owner_of.get(label, label) for label in labels]


def independent_groups(
    draws: Draws, owners: Sequence[str], varies: np.ndarray, *, correlated: bool = True
) -> dict[str, np.ndarray]:
    """Return columns that vary, by independent groups: owners are joined if any of their columns are drawn jointly.

    Without `correlated`, groups that are correlated by declaration remain separate.
    """
    return joined_columns(owners, draws.dependent(correlated=correlated), np.flatnonzero(varies))
