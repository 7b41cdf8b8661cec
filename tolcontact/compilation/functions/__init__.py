"""Ways to call a CasADi Function for many realizations at once: by name, interpreted, or compiled if that is faster."""

from tolcontact.compilation.functions.argument_columns import Located, located
from tolcontact.compilation.functions.named import IndexedFunction, InterpretedFunction, NamedFunction, flat

__all__ = ["IndexedFunction", "InterpretedFunction", "Located", "NamedFunction", "flat", "located"]
