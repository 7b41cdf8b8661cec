"""Arrays with their shapes in their types: Float[Array, "n part 12"]. The tests check them; a run does not.

A name means the same length in all arguments of a call, and in all arrays of a dataclass. Whoever checks shapes imports
jaxtyping first. A run does not, and saves its import: for a run, all types are arrays.
"""

import sys
from typing import TYPE_CHECKING

from numpy import ndarray

if TYPE_CHECKING or "jaxtyping" in sys.modules:
    from jaxtyping import Bool, Float, Int, Real
else:

    class Real:
        """The type of an array without its shape."""

        def __class_getitem__(cls, item: tuple[type, str]) -> type:
            return item[0]

    Bool = Float = Int = Real

Array = ndarray

__all__ = ["Array", "Bool", "Float", "Int", "Real"]
