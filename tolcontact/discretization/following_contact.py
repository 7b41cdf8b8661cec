"""Contact whose points follow from every pose, so that nothing is searched: what each kind of it states."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np

from tolcontact.arrays import Array, Bool, Float
from tolcontact.discretization.fixed_contact import ContactPoints
from tolcontact.geometry.surface import Surface


class FollowingContact(ContactPoints, ABC):
    """Contact whose points always have a row, and no triangle enters its gaps.

    A kind of contact derives from it, in a file of its own (see round_contact). Its equations derive from FixedGaps.
    """

    samples_faces: ClassVar[bool] = False

    @classmethod
    @abstractmethod
    def between(
        cls, moving: Surface, reference: Surface, reach: float, rounding: float, common: Mapping[str, Any]
    ) -> Self | None:
        """Return the contact of two faces; None if they may touch in another way.

        reach      [mm]: faces at a larger distance have no points
        rounding   [mm]: coordinate error of both bodies
        common     the fields that do not depend on the kind
        """

    @abstractmethod
    def touching(
        self, X_RM: Float[Array, "1 12"], points: Bool[Array, " point"], normals: Float[Array, "k 3"]
    ) -> Float[Array, "k 3"]:
        """Return the places of some points that touch at one pose, with normals there, in the frame of the reference part."""

    @abstractmethod
    def ends(self) -> tuple[Float[Array, "point 3"], Bool[Array, " point"], Bool[Array, " point"], float]:
        """Return what must not overhang the other face of a point under load.

        These are nominal places, whether they are on the moving part, whether they must not, and the overhang [mm] that may be.
        """

    @cached_property
    def facing(self) -> np.ndarray:
        return np.ones(len(self.P_m))

    def without(self, held: np.ndarray, distance: float) -> Self:
        return self

    def raw_depth(self, X_RM: np.ndarray, deviations: np.ndarray) -> float:
        return self.travel(X_RM)

    @property
    def curvature(self) -> float:
        return 0.0

    @property
    def may_miss_ends(self) -> bool:
        return False

    @cached_property
    def weights(self) -> np.ndarray:
        return np.ones(len(self.P_m))
