"""Where the stiffness of a part comes from: its own mesh and material, or a matrix of another program."""

from dataclasses import dataclass
from pathlib import Path

from tolcontact.arrays import Array, Float, Int


@dataclass(frozen=True, eq=False)
class MeshSource:
    """A part of one material, whose tetrahedra are made here.

    vertices, faces   the closed surface of the part, in its frame [mm]
    young, poisson    Young's modulus [MPa] and Poisson's ratio
    density           [kg/m^3]; None if nothing needs the mass
    step              the STEP file of the part, whose true faces are meshed if one of its solids has this surface
    element_size      longest edge [mm]; None for one by the thickness of the part
    """

    vertices: Float[Array, "vertex 3"]
    faces: Int[Array, "face 3"]
    young: float
    poisson: float
    density: float | None = None
    step: Path | None = None
    element_size: float | None = None


@dataclass(frozen=True, eq=False)
class MatrixSource:
    """A stiffness matrix of another program, condensed to the nodes where something acts.

    stiffness   file: .npz (K), Matrix Market .mtx, Nastran DMIG (.pch, .dmig, .bdf), Abaqus or CalculiX substructure .mtx
    nodes       file of the nodes in the part's frame [mm]: .csv (x, y, z, or number, x, y, z), or .npz (nodes, numbers)
    vertices, faces   the surface of the part, in its frame [mm], on which the nodes have to lie; None for no check
    tolerance         largest distance [mm] of a node from the surface: half the sheet thickness for shells
    """

    stiffness: Path
    nodes: Path
    vertices: Float[Array, "vertex 3"] | None = None
    faces: Int[Array, "face 3"] | None = None
    tolerance: float = 1.0
