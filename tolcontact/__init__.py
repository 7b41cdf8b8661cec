"""Tolerance analysis of rigid assemblies: Monte-Carlo variation simulation in which contact is resolved.

declare       Assembly, Box, Mesh, Locator, three_two_one, Tolerance
faces         Facing, Inside, Near, Brep
run           run, build, compare, Method
look          summarize, open_archive, model_of

The names are listed in __init__.pyi, and imported when they are first used.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
