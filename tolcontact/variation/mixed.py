"""The draws of Sobol' indices: two sets, and mixtures that have some columns of the one and all others of the other.

Saltelli et al. (2010): for each base realization k there are 2 + groups realizations: A, B, and A with the columns of each
group from B.
"""

from collections.abc import Sequence

import numpy as np

from tolcontact.variation.draws import Draws

OTHER = 1 << 40  # realizations that B begins at: no run comes so far


class MixedDraws:
    """Deviations as Draws give them: realization k (2 + groups) + m is mixture m of base realization k."""

    def __init__(self, draws: Draws, groups: Sequence[np.ndarray]) -> None:
        """`groups`: columns of deviations that change together; those of different groups are independent."""
        self._draws, self._groups = draws, groups

    @property
    def together(self) -> int:
        """How many realizations each base realization has."""
        return 2 + len(self._groups)

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Deviations (realization, contributor); see Draws."""
        count = self.together
        first, last = start // count, -(-stop // count)
        A = self._draws(seed=seed, start=first, stop=last)
        B = self._draws(seed=seed, start=OTHER + first, stop=OTHER + last)
        every = np.repeat(A[:, None], count, axis=1)
        every[:, 1] = B
        for member, columns in enumerate(self._groups, start=2):
            every[:, member, columns] = B[:, columns]
        return every.reshape(-1, A.shape[1])[start - first * count : stop - first * count]


def independent_groups(draws: Draws, owners: Sequence[str], *, correlated: bool = True) -> dict[str, np.ndarray]:
    """Columns by who owns them, so that groups are independent of each other: what is drawn together is one group.

    Without `correlated`, groups may be correlated by declaration, but not depend on each other in another way.
    """
    leader = list(range(len(owners)))

    def find(k: int) -> int:
        while leader[k] != k:
            k = leader[k]
        return k

    first: dict[str, int] = {}
    together = [[first.setdefault(owner, k), k] for k, owner in enumerate(owners)]
    for columns in [*together, *draws.dependent(correlated=correlated)]:
        for k in columns[1:]:
            one, other = sorted((find(int(columns[0])), find(int(k))))
            leader[other] = one
    found: dict[int, list[int]] = {}
    for k in range(len(owners)):
        found.setdefault(find(k), []).append(k)
    return {" + ".join(dict.fromkeys(owners[k] for k in columns)): np.array(columns) for columns in found.values()}
