"""A weld: points and directions at which a joint keeps the gaps between two parts."""

from dataclasses import dataclass

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
