"""Arrays in the data of a page: little-endian numbers in base64, with their shape."""

import base64
from typing import Any

import numpy as np

Packed = dict[str, Any]


def packed(values: Any, kind: str = "f4") -> Packed:
    """Return an array packed as floats of single precision, "f4", or whole numbers, "i4"."""
    array = np.ascontiguousarray(values, dtype=f"<{kind}")
    return {"shape": list(array.shape), "kind": kind, "data": base64.b64encode(array.tobytes()).decode()}
