"""A part in its nominal place, with its locators."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
import trimesh

from tolcontact.declaration import Locator, Part, ThreeTwoOne
from tolcontact.discretization.locators import Locators
from tolcontact.geometry.coordinate_error import COORDINATE_SPACING


@dataclass(frozen=True, eq=False)
class NominalPart:
    """A part in its nominal place.

    vertices, faces      its surface (vertex, 3) [mm], (face, 3), fine enough to show displacement fields
    locators             as `scheme` declares them; none if the part is fixed
    parent               index of the part that it is located on, or that carries it in a joint; None for the ground
    located              name of what its locators locate: its own, or "station.part" or "station.joint"
    movers               indices of the free parts whose corrections move it: parts that it is located on come first
    station              name of the station; empty in an assembly without stations
    carried              indices of the part that carries it and of itself in the station that joined them; None if it is not
                         carried
    owners               indices of the parts at whose points its locators are, if it is the first part of a joint
    """

    name: str
    part: Part
    placement: tuple[np.ndarray, np.ndarray]
    mesh: trimesh.Trimesh
    vertices: np.ndarray
    faces: np.ndarray
    locators: Locators
    scheme: ThreeTwoOne | tuple[Locator, ...] | None
    parent: int | None
    free: bool
    located: str
    movers: tuple[int, ...] = ()
    station: str = ""
    carried: tuple[int, int] | None = None
    owners: tuple[int, ...] = ()

    @cached_property
    def body(self) -> trimesh.Trimesh:
        """The mesh in its nominal place."""
        body = trimesh.Trimesh(self.placed(np.asarray(self.mesh.vertices)), self.mesh.faces, process=False)
        body.metadata |= {name: self.mesh.metadata[name] for name in (COORDINATE_SPACING,) if name in self.mesh.metadata}
        return body

    def placed(self, p: np.ndarray) -> np.ndarray:
        """Return nominal assembly coordinates (..., 3) [mm] of points (..., 3) in the part's own frame."""
        R_WP, t_WP = self.placement
        return p @ R_WP.T + t_WP
