"""Checksums, which show whether values have changed since they were written."""

from typing import Any

import numpy as np
from isal import isal_zlib

from tolcontact.vocabulary import ArchiveVariable


def crc32(variable: ArchiveVariable, values: Any, start: int = 0) -> int:
    """Return the CRC-32 of the values of a variable; `start` is the checksum of the values before them.

    Numbers are taken as little-endian bytes of the variable's kind, texts as UTF-8 with a zero byte behind each.
    """
    if variable.kind is str:
        data = "".join(f"{text}\0" for text in np.ravel(np.array(values, dtype=str))).encode("utf-8", "surrogateescape")
        return isal_zlib.crc32(data, start)
    return isal_zlib.crc32(np.ascontiguousarray(values, dtype=np.dtype(variable.kind).newbyteorder("<")).data, start)
