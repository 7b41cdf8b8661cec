"""Compilation of a model: its equations become functions, and its contact QP is built once.

.. include:: ../guide/compilation.md
"""

from tolcontact.compilation.functions import NamedFunction
from tolcontact.compilation.program import ContactGroup, Program, compile_program
from tolcontact.compilation.qp_terms import MANY_SLOTS
from tolcontact.compilation.solver import ACCURACY
from tolcontact.compilation.solvers import usable_solvers

__all__ = ["ACCURACY", "MANY_SLOTS", "ContactGroup", "NamedFunction", "Program", "compile_program", "usable_solvers"]
