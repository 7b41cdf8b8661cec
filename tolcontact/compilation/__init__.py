"""Compile: the equations of a model become Functions, and the contact problem a QP that is built once."""

from tolcontact.compilation.plugins import ACCURACY, usable_plugins
from tolcontact.compilation.program import ContactGroup, Program, compile_program
from tolcontact.compilation.rows import SLOTS

__all__ = ["ACCURACY", "SLOTS", "ContactGroup", "Program", "compile_program", "usable_plugins"]
