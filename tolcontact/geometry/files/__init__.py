"""Shape files: they are screened, read in another process, and split into bodies."""

from tolcontact.geometry.files.product import BREP, FROM_PRODUCT, STATED_FACES
from tolcontact.geometry.files.reading import Contents, ReadingLimits, Shape, key_of, read, read_files

__all__ = ["BREP", "FROM_PRODUCT", "STATED_FACES", "Contents", "ReadingLimits", "Shape", "key_of", "read", "read_files"]
