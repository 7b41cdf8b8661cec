"""Elastic parts: the material of a part, or a file with its stiffness matrix."""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from tolcontact.declaration.checks import LENGTH, POSITIVE, Check, Checked, Declaration
from tolcontact.declaration.values import is_finite, script_line
from tolcontact.user_functions import refuse_in_functions

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


class Deformable(Declaration):
    """A part that may be declared elastic."""

    noun: ClassVar[str] = "part"
    fixed: bool | None
    _elastics: list[Elastic]

    def elastic(
        self, E: float | None = None, nu: float | None = None, *, density: float | None = None,
        stiffness: str | Path | None = None, nodes: str | Path | None = None, pad: float | None = None,
        element_size: float | None = None,
    ) -> Elastic:  # fmt: skip
        """Declare that forces bend this part: `part.elastic(E=70e3, nu=0.33)`, or by the files of a matrix (see Elastic).

        E, nu             modulus [MPa] and Poisson's ratio of its material
        density           [kg/m^3], which `assembly.gravity` needs
        stiffness, nodes  files of a stiffness matrix [N/mm] without supports, and of its nodes [mm], in place of E and nu
        pad               [mm] radius over which a force at a point is spread
        element_size      [mm] longest edge of its tetrahedra, smaller than by default if `tolcontact check` asks for it
        """
        refuse_in_functions()
        elastic = Elastic(
            E=E, nu=nu, density=density, stiffness=stiffness, nodes=nodes, pad=pad, element_size=element_size,
            declared_at=script_line(),
        )  # fmt: skip
        self._elastics.append(elastic)
        return elastic

    @property
    def elasticity(self) -> Elastic | None:
        """Its elasticity; None for a rigid part."""
        return self._elastics[0] if self._elastics else None

    def elastic_faults(self) -> Iterator[str]:
        """Yield the faults of its elasticity."""
        for elastic in self._elastics:
            yield from elastic.faults()
        if len(self._elastics) > 1:
            yield f"it is declared elastic {len(self._elastics)} times; declare it once"
        if self._elastics and self.fixed:
            yield "it is elastic and fixed=True; leave fixed out, and hold it by its locators"


def gravity_faults(acceleration: tuple[float, float, float] | None, *, has_elastic: bool) -> Iterator[str]:
    """Yield the faults of an `acceleration` [m/s^2] of an assembly; it needs an elastic part, whose mass is known."""
    if acceleration is None:
        return
    if not (is_finite(acceleration) and any(acceleration)):
        yield f"gravity is {acceleration!r}; expected a nonzero acceleration [m/s^2], as in gravity((0, 0, -9.81))"
    elif not has_elastic:
        yield "it has gravity, which acts on elastic parts alone; declare the weights of rigid parts with assembly.force(...)"
