"""A model script: the stack of plates."""

from tests.cases import stack as assembly

__all__ = ["assembly"]
