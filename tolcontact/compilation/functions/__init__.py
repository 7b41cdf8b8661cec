"""Ways to call a CasADi Function for many realizations at once: by name, interpreted, or compiled if that is faster."""

from tolcontact.compilation.functions.named import InterpretedFunction, NamedFunction, flat

__all__ = ["InterpretedFunction", "NamedFunction", "flat"]
