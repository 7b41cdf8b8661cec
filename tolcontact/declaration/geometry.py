"""Shapes of parts, in the part's own frame, and their elasticity."""

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Literal

from tolcontact.declaration.checks import LENGTH, POSITIVE, TRUTH, Check, Checked, one_of
from tolcontact.input_files import fault_of
from tolcontact.texts import shown


@dataclass(frozen=True, repr=False)
class Box(Checked):
    """A block from the origin of its part's frame to (x, y, z) [mm], as in `tc.Box(100, 50, 10)`."""

    x: float
    y: float
    z: float

    checks, fault_prefix = dict.fromkeys("xyz", LENGTH), "box size along "

    def __str__(self) -> str:
        return f"box {self.x:g} x {self.y:g} x {self.z:g} mm"


@dataclass(frozen=True, repr=False)
class Pin(Checked):
    """A round pin about the z axis of its part's frame, as in `tc.Pin(8, 20)`.

    Its `diameter` and `length` are in mm; it reaches from z = -length to 0. The `head` of a bolt is above z = 0.
    """

    diameter: float
    length: float
    head: bool = False

    checks, fault_prefix = {"diameter": LENGTH, "length": LENGTH, "head": TRUTH}, "pin "

    def __str__(self) -> str:
        return f"pin {self.diameter:g} x {self.length:g} mm{' with a head' if self.head else ''}"


STEP = (".step", ".stp")
Unit = Literal["um", "mm", "cm", "m", "in", "ft"]
UNITS: dict[str, float] = {"um": 1e-3, "mm": 1.0, "cm": 10.0, "m": 1e3, "in": 25.4, "ft": 304.8}  # [mm]


@dataclass(frozen=True, eq=False, repr=False)
class Mesh(Checked):
    """A triangle surface: a file (STL, OBJ, PLY, GLB, STEP), or a `trimesh.Trimesh`. Normals point outward.

    `tc.Mesh("bracket.stl", units="in")` has the `source` "bracket.stl". `units` ("mm", "in", ...) apply to the source. By
    default a STEP file states its own, a GLB file is in m, a Trimesh has its `units` if they are set, and all others are in
    mm. STEP faces are triangulated to within `chord` [mm] (by default 2 um, or 5e-6 of the extent of files beyond 0.4 m, and
    coarser if that gives too many triangles). They keep their boundary representation for `tc.select.Brep`; this needs the
    extra `tolcontact[step]`. `body` is the name or the number (from 1) of a body in a STEP file with several, which is read in
    its own frame; the only body of a file is read in its place.
    """

    source: Any
    units: Unit | None = None
    body: str | int | None = None
    chord: float | None = None

    checks, fault_prefix = {"chord": LENGTH, "units": one_of(UNITS)}, "mesh "

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        if self.chord is not None and not self.is_step:
            yield "mesh chord is given, but only STEP files are triangulated; leave it out"
        if self.body is not None and not self.is_step:
            yield f"mesh body is {self.body!r}; only STEP files hold bodies that have names and numbers; leave it out"
        if isinstance(self.body, bool) or not isinstance(self.body, str | int | None):
            yield f"mesh body is {self.body!r}; expected the name of a body, or its number from 1"
        if self.units is not None and self.is_step:
            yield f'"{self.source}" is a STEP file, which states its own units; leave units out'
        if isinstance(self.source, str | Path):
            if fault := fault_of(Path(self.source)):
                yield f'mesh file "{self.source}" {fault}; give the path of an STL, OBJ, PLY, GLB or STEP file'
        elif not (hasattr(self.source, "vertices") and hasattr(self.source, "faces")):
            yield f"mesh source is a {type(self.source).__name__}; expected a file's path or a trimesh.Trimesh"

    @property
    def is_step(self) -> bool:
        """Whether the source is a STEP file, by its name."""
        return isinstance(self.source, str | Path) and Path(self.source).suffix.lower() in STEP

    def __str__(self) -> str:
        if isinstance(self.source, str | Path):
            return shown(f"mesh {Path(self.source).name}" + (f" {self.body}" if self.body is not None else ""))
        return f"mesh of {len(getattr(self.source, 'faces', ()))} triangles"


Geometry = Box | Mesh | Pin
MIN_POISSON, MAX_POISSON = -1.0, 0.5


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


MODULUS = Check(lambda value: _is_number(value) and value > 0, "a modulus in MPa above 0, such as 70e3", POSITIVE)
POISSON = Check(
    lambda value: _is_number(value) and MIN_POISSON < value < MAX_POISSON, "a Poisson's ratio between -1 and 0.5", float
)
DENSITY = Check(lambda value: _is_number(value) and value > 0, "a density in kg/m^3 above 0, such as 2700", POSITIVE)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Elastic(Checked):
    """The elasticity of a part, linear about its stress-free shape: from its own mesh, or from a stiffness matrix.

    E          Young's modulus [MPa] of an isotropic material
    nu         its Poisson's ratio
    density    [kg/m^3], which `assembly.gravity` needs
    stiffness  file with the stiffness matrix [N/mm] of a finite-element program, without supports, in place of E and nu
    nodes      file with the nodes [mm] of that matrix, in the frame of the part
    pad        [mm] radius over which a force at a point is spread; by default the body's
    element_size  [mm] longest edge of the tetrahedra of a part that is meshed here; by default by its thickness
    """

    E: float | None = None
    nu: float | None = None
    density: float | None = None
    stiffness: str | Path | None = None
    nodes: str | Path | None = None
    pad: float | None = None
    element_size: float | None = None
    declared_at: str = ""
    fault_prefix = "elastic "
    checks: ClassVar = {"E": MODULUS, "nu": POISSON, "density": DENSITY, "pad": LENGTH, "element_size": LENGTH}

    def faults(self) -> Iterator[str]:
        yield from super().faults()
        has_material, has_matrix = self.E is not None or self.nu is not None, self.stiffness is not None
        if has_material and has_matrix:
            yield "elastic has E or nu and a stiffness; give the material, or the files of a matrix"
        elif has_matrix and self.nodes is None:
            yield 'elastic has a stiffness without nodes; give the file with the nodes of the matrix, as in nodes="nodes.csv"'
        elif has_matrix and self.element_size is not None:
            yield "elastic has an element_size and a stiffness; a matrix has the mesh of its program, so leave element_size out"
        elif not has_matrix and (self.E is None or self.nu is None):
            yield "elastic needs E and nu, as in elastic(E=70e3, nu=0.33), or stiffness and nodes"

    def __str__(self) -> str:
        if self.stiffness is not None:
            return f"elastic, by {Path(self.stiffness).name}"
        size = "" if self.element_size is None else f", elements of {self.element_size:g} mm"
        return f"elastic, E {self.E:g} MPa, nu {self.nu:g}{size}"


def elastic_faults(elastics: Sequence[Elastic], fixed: bool | None) -> Iterator[str]:
    """Yield the faults of what is declared of a part's elasticity."""
    for elastic in elastics:
        yield from elastic.faults()
    if len(elastics) > 1:
        yield f"it is declared elastic {len(elastics)} times; declare it once"
    if elastics and fixed:
        yield "it is elastic and fixed=True; leave fixed out, and hold it by its locators"
