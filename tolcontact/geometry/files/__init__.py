"""Shape files: they are screened, read in another process, and split into bodies."""

from tolcontact.geometry.files.product import BREP, FACE_NAMES, STATED_FACES, SURFACES
from tolcontact.geometry.files.reading import Contents, ReadingLimits, Shape, key_of, read, read_files

__all__ = [
    "BREP",
    "FACE_NAMES",
    "STATED_FACES",
    "SURFACES",
    "Contents",
    "ReadingLimits",
    "Shape",
    "key_of",
    "read",
    "read_files",
]
