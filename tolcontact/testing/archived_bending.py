"""The opening of gaps between elastic parts, from an archive alone."""

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms


class ArchivedBending:
    """How elastic parts open the gaps at some contact points, by their indices; `loads` are the loads at these points.

    holds   (load,): whether it is a two-sided locator, whose gap counts either way
    """

    def __init__(self, tree: xr.DataTree, points: np.ndarray) -> None:
        group = tree.children[terms.ELASTIC_GROUP].to_dataset()
        self.loads = np.flatnonzero(np.isin(group[terms.POINT_OF_LOAD.name].values, points))
        self.holds = group[terms.HOLDS.name].values[self.loads] != 0
        self._by_load = group[terms.FLEXIBILITY.name].values[self.loads]
        self._by_forces = group[terms.OPENING.name].values[self.loads]
        self._weld_rows = group[terms.WELD_OF_LOAD.name].values[self.loads]

    def kept(self, gaps: np.ndarray) -> np.ndarray:
        """Return the gaps (realization, point) [mm] that welds keep, from those of all welds; 0 of other points."""
        return np.where(self._weld_rows >= 0, gaps[:, self._weld_rows], 0.0) if gaps.size else np.zeros((1, len(self.loads)))

    def openings(self, loads: np.ndarray) -> np.ndarray:
        """Return the openings (realization, point) [mm] under reactions `loads` (realization, load) [N]."""
        return np.asarray(loads @ self._by_load.T + self._by_forces)
