"""Arrays with their shapes in their types: Float[Array, "n part 12"]. The tests check them; a run does not.

A name stands for the same length in all arguments of a call, and in all arrays of a dataclass.
"""

from jaxtyping import Bool, Float, Int, Real
from numpy import ndarray

Array = ndarray

__all__ = ["Array", "Bool", "Float", "Int", "Real"]
