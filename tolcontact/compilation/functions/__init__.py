"""Ways to call a CasADi Function for many realizations at once: by name, interpreted, compiled, or whichever is faster."""

from tolcontact.compilation.functions.named import IndexedFunction, InterpretedFunction, NamedFunction, flat
from tolcontact.compilation.functions.places import Located, located

__all__ = ["IndexedFunction", "InterpretedFunction", "Located", "NamedFunction", "flat", "located"]
