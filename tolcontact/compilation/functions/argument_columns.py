"""Column indices of the arguments of a Function in arrays that several elements share."""

import ctypes
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from tolcontact.arrays import Array, Int


class Located(NamedTuple):
    """An array (realization, column) as machine code needs it: its address, its shape, and the stride of its rows."""

    array: np.ndarray
    address: int
    rows: int
    columns: int
    step: int

    @classmethod
    def of(cls, array: np.ndarray) -> "Located":
        """Return an array with its address. Raises ValueError for another data type, or rows that are not contiguous."""
        (rows, columns), (row, entry) = array.shape, array.strides
        if array.dtype != np.float64 or (entry != array.itemsize and columns > 1 and rows):
            raise ValueError(f"rows of {array.dtype} with strides {array.strides}; expected rows of float64 without gaps")
        return cls(array, array.__array_interface__["data"][0], rows, columns, row // array.itemsize if rows > 1 else 0)


def located(arrays: Mapping[str, np.ndarray]) -> dict[str, Located]:
    """Return arrays with their addresses, by name."""
    return {name: Located.of(array) for name, array in arrays.items()}


class ArgumentColumns:
    """The columns (element, entry) of each argument of a Function, inputs first, in their arrays.

    elements   number of elements
    widths     smallest number of columns that the array of each argument must have
    """

    def __init__(self, columns: Sequence[Int[Array, "element _"]]) -> None:
        self.tables = [np.ascontiguousarray(table, dtype=np.int64) for table in columns]
        self.elements = len(self.tables[0])
        self.widths = [int(table.max(initial=-1)) + 1 for table in self.tables]
        addresses = [table.__array_interface__["data"][0] for table in self.tables]
        self.addresses = (ctypes.c_void_p * len(addresses))(*addresses)

    @classmethod
    def of_one(cls, sizes: Sequence[int]) -> "ArgumentColumns":
        """Return the columns of one element whose arguments, of these sizes, are whole arrays."""
        return cls([np.arange(size)[None] for size in sizes])
