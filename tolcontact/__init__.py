"""Tolerance analysis of rigid assemblies: Monte-Carlo variation simulation in which contact is resolved.

declare       Assembly, Box, Mesh, Locator, three_two_one, Tolerance; and what these return: Part, Face, Point, ContactPair, ...
faces         Facing, Inside, Near, Brep
run           check, build, run, compare, simulate_blocks, Method, Program
look          summarize, open_archive, model_of, Status
catch         TolcontactError: ModelError, OptionError, ArchiveError, ScriptError; ContactWarning, UnitsWarning

The names are listed in __init__.pyi, and imported when they are first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
