"""What elastic parts add to a model: welds, which keep gaps between parts, and loads at contact points."""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from tolcontact.arrays import Array, Float, Int


@dataclass(frozen=True, eq=False)
class Weld:
    """The rows of a joint: gaps n . (x_m - x_r) between two parts.

    station             that joins the parts
    moving, reference   indices of the parts in that station
    P_m, P_r, n_r       (row, 3) points and directions, nominal
    columns             (row,) inputs of a realization that hold the gaps at the end of the station
    """

    station: str
    moving: int
    reference: int
    P_m: Float[Array, "row 3"]
    P_r: Float[Array, "row 3"]
    n_r: Float[Array, "row 3"]
    columns: Int[Array, " row"]


class ElasticInputs:
    """The inputs and the loads of a nominal model with elastic parts."""

    pairs: Any
    contributors: Any
    welds: tuple[Weld, ...]

    @property
    def input_count(self) -> int:
        """The number of inputs of a realization: its deviations, and the gaps that welds keep."""
        return len(self.contributors) + sum(len(weld.columns) for weld in self.welds)

    @cached_property
    def loads(self) -> Int[Array, "load 2"]:
        """The pair and the point of each load: of the reactions at the contact points of pairs with an elastic part."""
        points = [(k, point) for k, pair in enumerate(self.pairs) if pair.elastic for point in range(len(pair.P_m))]
        return np.array(points, dtype=int).reshape(-1, 2)
