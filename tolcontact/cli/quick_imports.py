"""Fast imports of commands, which would take longer than a small run: without garbage collection and rarely used modules."""

import contextlib
import gc
import importlib.util
import sys
from collections.abc import Iterator, Sequence
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType

# Modules that libraries import, but that commands rarely need: each is loaded on the first access to one of its attributes.
DEFERRED = frozenset(
    {
        "PIL.Image",  # by trimesh, for textures
        "numpy.f2py",  # by SciPy, which lists the content of NumPy
        "trimesh.bounds",  # which imports scipy.optimize
        "trimesh.nsphere",  # which also imports scipy.optimize
        "trimesh.path.raster",  # which imports PIL
        "trimesh.path.simplify",  # which imports trimesh.nsphere
        "trimesh.smoothing",  # which imports scipy.sparse.linalg
        "trimesh.voxel",  # which imports scipy.ndimage
        "yaml",  # by Numba, for a file of settings
    }
)


@contextlib.contextmanager
def quick_imports() -> Iterator[None]:
    """Import modules quickly.

    The cyclic garbage collector finds nothing in modules, but takes a fifth of the time of all imports, and again as long at
    the end of the process. So it is off, and ignores the imported objects afterwards.
    """
    was_collecting, finder, module_count = gc.isenabled(), _DeferringFinder(), len(sys.modules)
    gc.disable()
    sys.meta_path.insert(0, finder)
    try:
        yield
    finally:
        sys.meta_path.remove(finder)
        if was_collecting:
            if len(sys.modules) > module_count:  # otherwise only garbage of the caller would be frozen
                gc.freeze()
            gc.enable()


class _DeferringFinder(MetaPathFinder):
    """The finder of modules that are loaded on the first access to an attribute."""

    def find_spec(self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        """Return the specification of the other finders, with a deferring loader."""
        if fullname not in DEFERRED:
            return None
        finders = (finder for finder in sys.meta_path if finder is not self)
        spec = next((spec for finder in finders if (spec := finder.find_spec(fullname, path, target))), None)
        if spec is not None and spec.loader is not None:
            spec.loader = importlib.util.LazyLoader(spec.loader)
        return spec
