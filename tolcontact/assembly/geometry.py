"""Shapes of parts, in the part's own frame."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any


@dataclass(frozen=True)
class Box:
    """A block from the origin of its part's frame to (x, y, z) [mm]."""

    x: float
    y: float
    z: float

    def faults(self) -> Iterator[str]:
        for axis in "xyz":
            size = getattr(self, axis)
            if not (isinstance(size, int | float) and math.isfinite(size) and size > 0):
                yield f"box size along {axis} is {size!r}; expected a length in mm above 0"

    def __str__(self) -> str:
        return f"box {self.x:g} x {self.y:g} x {self.z:g} mm"


@dataclass(frozen=True, eq=False)
class Mesh:
    """A triangle mesh, coordinates in mm: a file that trimesh reads, or a `trimesh.Trimesh`."""

    source: Any

    def faults(self) -> Iterator[str]:
        if isinstance(self.source, str | Path):
            path = Path(self.source)
            if not path.is_file():
                yield f'mesh file "{path}" does not exist; give the path of a file that trimesh reads (STL, OBJ, PLY, GLB)'
        elif not (hasattr(self.source, "vertices") and hasattr(self.source, "faces")):
            yield f"mesh source is a {type(self.source).__name__}; expected a file's path or a trimesh.Trimesh"

    def __str__(self) -> str:
        if isinstance(self.source, str | Path):
            return f"mesh {Path(self.source).name}"
        return f"mesh of {len(getattr(self.source, 'faces', ()))} triangles"
