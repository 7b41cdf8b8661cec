"""Places of the arguments of a Function in arrays that hold the numbers of several elements."""

import ctypes
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Int


class Located(NamedTuple):
    """An array (realization, column) and where machine code finds it: its address, its shape and how far its rows are apart."""

    array: np.ndarray
    address: int
    rows: int
    columns: int
    step: int

    @classmethod
    def of(cls, array: np.ndarray) -> "Located":
        """Return where an array is. Raises ValueError for an array of other numbers, or of rows with gaps."""
        (rows, columns), (row, entry) = array.shape, array.strides
        if array.dtype != np.float64 or (entry != array.itemsize and columns > 1 and rows):
            raise ValueError(f"rows of {array.dtype} with strides {array.strides}; expected rows of float64 without gaps")
        return cls(array, array.__array_interface__["data"][0], rows, columns, row // array.itemsize if rows > 1 else 0)


def located(arrays: Mapping[str, np.ndarray]) -> dict[str, Located]:
    """Return where arrays are, by name."""
    return {name: Located.of(array) for name, array in arrays.items()}


class ArgumentPlaces:
    """Where the arguments of a Function, inputs first, stand in their arrays: columns (element, entry) of each argument.

    elements   number of elements
    widths     number of columns that the array of each argument must have, at least
    """

    def __init__(self, columns: Sequence[Int[Array, "element _"]]) -> None:
        self.columns = [np.ascontiguousarray(table, dtype=np.int64) for table in columns]
        self.elements = len(self.columns[0])
        self.widths = [int(table.max(initial=-1)) + 1 for table in self.columns]
        addresses = [table.__array_interface__["data"][0] for table in self.columns]
        self.addresses = (ctypes.c_void_p * len(addresses))(*addresses)

    @classmethod
    def of_one(cls, sizes: Sequence[int]) -> "ArgumentPlaces":
        """Return the places of one element, whose arguments of these sizes are whole arrays."""
        return cls([np.arange(size)[None] for size in sizes])
