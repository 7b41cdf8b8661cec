"""The netCDF archive: written block by block with the netCDF4 library, read with xarray."""

from tolcontact.archive.header import Run
from tolcontact.archive.reader import model_of, open_archive, opened
from tolcontact.archive.room import bytes_of_rows, size_in_words
from tolcontact.archive.rows import check_rows
from tolcontact.archive.stored import stored
from tolcontact.archive.taking import taken
from tolcontact.archive.writer import ArchiveWriter

__all__ = [
    "ArchiveWriter",
    "Run",
    "bytes_of_rows",
    "check_rows",
    "model_of",
    "open_archive",
    "opened",
    "size_in_words",
    "stored",
    "taken",
]
