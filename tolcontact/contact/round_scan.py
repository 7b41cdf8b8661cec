"""Gaps of the contact points of round faces."""

from dataclasses import dataclass

import numpy as np

from tolcontact.compilation import NamedFunction
from tolcontact.contact.scan import Scan


@dataclass(frozen=True, eq=False)
class RoundScan(Scan):
    """The points of round faces, found anew at every pose. They always have a row of the QP, so that none is looked for.

    gaps_at    X_RM, deviations -> gaps (realization, point)
    """

    gaps_at: NamedFunction

    def gaps(self, relative: np.ndarray, deviations: np.ndarray) -> np.ndarray:
        return self.gaps_at(X_RM=relative, deviations=deviations)["gaps"]
