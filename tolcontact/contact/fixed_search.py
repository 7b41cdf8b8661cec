"""The search of fixed contact points: all of them, the points that may be active, and their positions at other poses.

Other searches derive from it (see standing_search, bounded_search).
"""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

import numpy as np
from scipy.spatial import KDTree

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.compilation import Program
from tolcontact.contact import kernel
from tolcontact.contact.raised_scan import RaisedScan, raised_scan
from tolcontact.contact.scan import FixedScan, ProjectedScan, Scan, pair_scan
from tolcontact.contact.slots import Slots
from tolcontact.contact.starts import FIRST, Start
from tolcontact.geometry.minima_kernel import FIRST_PLACE

MAX_CLUSTERS = 6
FORM_CLUSTERS = 8  # of faces with form, which touch at more places
BULGE_SHARE = 1 / 2500  # of the smallest tolerance range: accepted penetration of planes with form between contact points
MIN_BULGE = 1e-7  # mm


class Search(NamedTuple):
    """How places are searched at the poses of n realizations.

    start      starts that are guarded, parted or free search bounded pairs in their own way (see BoundedSearch); if it is
               projected, points against curved faces are projected again
    width      in steps: how many times the limit for an answer active places persist beyond their edges
    at_rest    (n,): realizations whose active places do not persist
    deepest    (n,) [mm]: deeper places of free bodies are on the far side of a body and do not count
    ceilings   (n,) [mm]: places with larger gaps need not be found
    """

    start: Start = FIRST
    width: float = 0.0
    at_rest: Bool[Array, " n"] | None = None
    deepest: Float[Array, " n"] | None = None
    ceilings: Float[Array, " n"] | None = None


class Carriers(NamedTuple):
    """Points of a pair that are under load.

    realization   the realization of each point
    places        (point, 3), nominal, on the part opposite the surface that they touch
    on_moving     whether that is the moving part
    spacing       the usual spacing of the points [mm]; for round faces, the permitted overhang beyond a wall
    """

    realization: Int[Array, " point"]
    places: Float[Array, "point 3"]
    on_moving: Bool[Array, " point"]
    spacing: float


class FixedSearch:
    """Fixed contact points of a pair of a program, given by its index.

    tables      moment tables (moment, point) of the sides that enter the objective
    is_closed   whether the set of points that may be active is closed, see Method
    """

    def __init__(self, program: Program, index: int, tables: Sequence[np.ndarray] = ()) -> None:
        self.program, self.index, self.pair = program, index, program.nominal.pairs[index]
        self._tables, self._smallest = tables, program.nominal.assembly.smallest_zone()
        self.is_closed, is_exact = program.method.is_closed, program.method.is_exact
        self.has_minima = is_exact and self.is_closed and bool(np.isfinite(self._smallest)) and self.pair.minima is not None
        self.is_curved = is_exact and self.pair.curvature > 0
        self._bulge = max(BULGE_SHARE * self._smallest, MIN_BULGE)
        self.clusters = FORM_CLUSTERS if self.pair.has_form else MAX_CLUSTERS

    # Of all contact points, at any poses.

    def gaps(
        self, X_RM: Float[Array, "n 12"], deviations: Float[Array, "n contributor"], points: np.ndarray | None = None
    ) -> Float[Array, "n point"]:
        """Return the gaps (n, point) [mm] of some contact points between rigid bodies; of all points by default."""
        points = np.arange(len(self.pair.P_m)) if points is None else points
        heights = self.pair.offsets.heights(deviations, np.broadcast_to(points, (len(X_RM), len(points))))
        return np.asarray(self.pair.nominal_gaps(X_RM, points) - heights)

    def touching_counts(
        self, X_RM: Float[Array, "n 12"], deviations: Float[Array, "n contributor"], limit: float
    ) -> Int[Array, " point"]:
        """Return the number of poses (point,) at which the gap of a contact point is below `limit` [mm]."""
        gaps, counts = self.program.gaps[self.index], np.zeros(len(self.pair.P_m), dtype=np.int64)
        kernel.count_below(gaps.basis, gaps.columns, gaps.coordinates, X_RM, deviations, limit, counts)
        return counts

    def touching(
        self, X_RM: Float[Array, "1 12"], deviations: Float[Array, "1 contributor"], nearness: float
    ) -> tuple[Float[Array, "point 3"], Float[Array, "point 3"]]:
        """Return the points with a gap below `nearness` [mm] at one pose, and normals, in the frame of the reference part."""
        is_near = self.pair.nominal_gaps(X_RM)[0] < nearness
        return pose.apply(X_RM[0], self.pair.P_m[is_near]), self.pair.n_r[is_near]

    # In the resolution of contact.

    def survey(
        self, X_RM: Float[Array, "n 12"], deviations: Float[Array, "n contributor"], activity: float
    ) -> tuple[Int[Array, " n"], Float[Array, "n side moment"]]:
        """Return the number of points whose gap is below `activity` [mm], and their moments."""
        return self._all_points.survey(X_RM, deviations, activity)

    @cached_property
    def _all_points(self) -> FixedScan:
        """The scan of all contact points."""
        return pair_scan(self.pair, self.program.gaps[self.index], self._tables, self.clusters)

    @cached_property
    def fixed(self) -> FixedScan:
        """The scan of the points that may be active. If the paper's set may be, points between the corners count, too."""
        gaps = self.program.gaps[self.index]
        return pair_scan(self.pair, gaps, (), self.clusters, gaps.corners) if self.is_closed else self._all_points

    def scan(
        self,
        X_RM: Float[Array, "n 12"],
        deviations: Float[Array, "n contributor"],
        search: Search,
        former: Scan | None,
        slots: Slots | None,
    ) -> Scan:
        """Return the scan of the points that may be active at X_RM.

        former   the scan of the same realizations at earlier poses, with sums of heights
        slots    the places that were active
        """
        if search.start.projected and self.is_curved:
            return self.projected(X_RM)
        if not self.pair.has_form:
            return self.fixed
        raised = former if isinstance(former, RaisedScan) else raised_scan(self.fixed, deviations, always=self.has_minima)
        if not (self.has_minima and isinstance(raised, RaisedScan)):
            return raised
        is_raw = not isinstance(former, RaisedScan)
        return raised.with_minima(self.pair, X_RM, deviations, self._bulge, is_raw=is_raw, in_steps=search.width > 0)

    def projected(self, X_RM: Float[Array, "n 12"]) -> ProjectedScan:
        """Return a scan of the points, each projected again at X_RM onto the curved reference face.

        Points that overhang its rim by half their spacing still count, so that none come and go with every step.
        """
        scan, surface = self.fixed, self.pair.reference_face
        assert surface is not None
        moved = pose.apply(X_RM, scan.pair.P_m)
        feet, normals, over = surface.project(moved.reshape(-1, 3), margin=self._margin)
        if self.pair.coordinate_error:
            feet = feet - self.pair.coordinate_error * normals
        return ProjectedScan(scan, feet.reshape(moved.shape), normals.reshape(moved.shape), over.reshape(moved.shape[:2]))

    @cached_property
    def _margin(self) -> float:
        """Half the usual spacing of contact points [mm]: the radius of the surroundings that each represents."""
        P_m = self.pair.P_m
        return float(np.median(KDTree(P_m).query(P_m, k=2)[0][:, 1])) / 2 if len(P_m) > 1 else 0.0

    def raw_active(
        self, X_RM: Float[Array, "n 12"], deviations: Float[Array, "n contributor"], activity: float
    ) -> Bool[Array, "n point"] | None:
        """Return which points (n, point) are active in the raw state, by their gaps; None if every point may be later."""
        return None if self.is_closed or self.pair.is_supports else self.fixed.gaps(X_RM, deviations) < activity

    def carriers(self, loaded: Bool[Array, "n row"], points: Int[Array, " row"] | Slots) -> Carriers:
        """Return the points under load, of `points` that always have a row, or in the slots."""
        if isinstance(points, Slots):
            realization, column = np.nonzero(loaded & points.filled)
            places = self._places(points.points[realization, column])
        else:
            realization, column = np.nonzero(loaded)
            places = self.pair.P_m[points[column]]
        return Carriers(realization, places, np.ones(len(places), dtype=bool), 2 * self._margin)

    def _places(self, labels: Int[Array, " point"]) -> Float[Array, "point 3"]:
        """Return the nominal places of contact points, and of minima of the gap between them, by their labels."""
        is_point, minima = labels < FIRST_PLACE, self.pair.minima
        places = self.fixed.pair.P_m[np.where(is_point, labels, 0)]
        return places if minima is None else np.where(is_point[:, None], places, minima.points(labels))
