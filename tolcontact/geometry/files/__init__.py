"""Files of shapes: looked at, read in a process of their own, and told apart into bodies."""

from tolcontact.geometry.files.product import BREP, FACE_NAMES, SURFACES
from tolcontact.geometry.files.reading import Contents, Shape, key_of, read, read_files

__all__ = ["BREP", "FACE_NAMES", "SURFACES", "Contents", "Shape", "key_of", "read", "read_files"]
