"""Places of the arguments of a Function in arrays that hold the numbers of several elements."""

import ctypes
from collections.abc import Sequence

import numpy as np

from tolcontact.arrays import Array, Int


class Places:
    """Where the arguments of a Function, inputs first, stand in their arrays: columns (element, entry) of each argument.

    elements   number of elements
    widths     number of columns that the array of each argument must have, at least
    """

    def __init__(self, columns: Sequence[Int[Array, "element _"]]) -> None:
        self.columns = [np.ascontiguousarray(table, dtype=np.int64) for table in columns]
        self.elements = len(self.columns[0])
        self.widths = [int(table.max(initial=-1)) + 1 for table in self.columns]
        self.addresses = pointers(self.columns)

    @classmethod
    def of_one(cls, sizes: Sequence[int]) -> "Places":
        """Return the places of one element, whose arguments of these sizes are whole arrays."""
        return cls([np.arange(size)[None] for size in sizes])


def pointers(arrays: Sequence[np.ndarray]) -> ctypes.Array:
    """Return the addresses of arrays, for machine code."""
    return (ctypes.c_void_p * len(arrays))(*[array.__array_interface__["data"][0] for array in arrays])
