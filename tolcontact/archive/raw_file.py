"""An archive that has room for all its values: they are overwritten in place, past the netCDF library.

The library takes as long to write a block as contact takes to resolve it, must not be called by two threads at once, and
locks the file against readers. A writer needs only the location of each variable's bytes from it.
"""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

import h5py
import numpy as np

from tolcontact import vocabulary as terms
from tolcontact.checksums import crc32
from tolcontact.vocabulary import ArchiveVariable


class BytePlace(NamedTuple):
    """Where the values of a variable lie: chunks of `rows` rows (along the first dimension), each at its offset."""

    kind: np.dtype
    rows: int
    offsets: list[int]


class RawFile:
    """The values of an archive on its disk. A row is the values at one index of a variable's first dimension."""

    def __init__(self, path: Path) -> None:
        """Open the file. Raises OSError if it cannot be read and written."""
        self._places: dict[str, BytePlace] = {}
        with h5py.File(path, "r", locking=False) as file:
            names: list[bytes] = []
            h5py.h5o.visit(file.id, names.append)
            for name in names:
                item = h5py.h5o.open(file.id, name)
                if isinstance(item, h5py.h5d.DatasetID):
                    self._places[name.decode()] = _place(item)
        self._file = path.open("r+b", buffering=0)

    def close(self) -> None:
        self._file.close()

    def has(self, group: str, variable: ArchiveVariable) -> bool:
        return f"{group}/{variable.name}".lstrip("/") in self._places

    def overwrite(self, group: str, variable: ArchiveVariable, rows: Any, start: int = 0) -> None:
        """Overwrite rows of a variable, from row `start` on, in the group of that path."""
        kind, chunk_rows, offsets = self._places[f"{group}/{variable.name}".lstrip("/")]
        values = np.atleast_1d(np.ascontiguousarray(rows, dtype=kind))
        width, done = values.nbytes // max(len(values), 1), 0
        data = values.reshape(-1).view(np.uint8).data
        while width and done < len(values):
            chunk, inside = divmod(start + done, chunk_rows)
            count = min(chunk_rows - inside, len(values) - done)
            self._write(offsets[chunk] + inside * width, data[done * width : (done + count) * width])
            done += count

    def _write(self, offset: int, data: memoryview) -> None:
        self._file.seek(offset)
        while data:  # the system may take less than all, and then says why
            data = data[self._file.write(data) :]

    def overwrite_together(self, values: Mapping[str, Mapping[ArchiveVariable, Any]]) -> None:
        """Overwrite the values of groups, by their paths, and their checksums. A run that is killed meanwhile leaves -1."""
        for group in values:
            self.overwrite(group, terms.GROUP_CHECKSUM, terms.UNFINISHED)
        for group, variables in values.items():
            for variable, array in variables.items():
                self.overwrite(group, variable, array)
        for group, variables in values.items():
            checksum = 0
            for variable, array in variables.items():
                checksum = crc32(variable, array, checksum)
            self.overwrite(group, terms.GROUP_CHECKSUM, checksum)


def _place(item: h5py.h5d.DatasetID) -> BytePlace:
    """Return where the values of a variable lie.

    The variable is given by its handle: the h5py objects of handles take several times as long.
    """
    if item.get_create_plist().get_layout() != h5py.h5d.CHUNKED:
        offset = item.get_offset()
        return BytePlace(item.dtype, max((1, *item.shape[:1])), [] if offset is None else [offset])
    chunks: list[tuple[int, int]] = []
    item.chunk_iter(lambda chunk: chunks.append((chunk.chunk_offset[0], chunk.byte_offset)))
    return BytePlace(item.dtype, item.get_create_plist().get_chunk()[0], [offset for _, offset in sorted(chunks)])
