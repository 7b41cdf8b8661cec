"""Contact groups: parts that contact couples to each other. Each group has its own QP."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.declaration.locator import FIRST_ORDER
from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.mechanics.correction import Mobility
from tolcontact.mechanics.displacement import moment_table
from tolcontact.mechanics.pose import Number, Vector
from tolcontact.method import Method

BALL_SHARE = 0.01  # of the group's length: radius of the ball that a point represents


@dataclass(frozen=True, eq=False)
class Side:
    """One side of a pair whose points can be displaced: its points, and the position of their part in the group.

    is_moving     whether it is the moving side
    radii         (point,) [mm]: of the spheres that the points represent (see ContactPoints.counted)
    centre        (3,) [mm]: nominal reference point of the moments
    face_moments  (10,): the moments of the part of the face that is opposite to the other one, if there is one: all points
                  together count as this part, however many they are
    density       points per area [1/mm^2] of the faces that count in the group, by which their areas are multiplied
    all_moments   (10,): the moments of all points as small balls, so that points on a line constrain all rotations, too
    """

    pair: int
    part: int
    is_moving: bool
    points: np.ndarray
    radii: np.ndarray
    weights: np.ndarray
    centre: Vector
    face_moments: np.ndarray | None
    density: float
    all_moments: Vector

    @property
    def moments(self) -> np.ndarray:
        """The moments (10,) of all points that an objective counts."""
        return self.table.sum(axis=1) if self.face_moments is None else self.face_moments

    @property
    def table(self) -> np.ndarray:
        """The moments of each point, shape (moment, point), times its weight."""
        return moment_table(self.points, np.asarray(self.centre), self.radii) * self.weights

    @property
    def spread_points(self) -> np.ndarray:
        """Points (_, 3) [mm], the same number for each contact point, with the moments of the spheres."""
        if not self.radii.any():
            return self.points
        ends = np.vstack([np.eye(3), -np.eye(3)])
        return (self.points[:, None] + self.radii[:, None, None] * ends).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Load:
    """A force on a part that contact moves.

    part     its position in the group
    point    (3,) [mm], nominal
    vector   (3,) [N]
    columns  (cause,) of the deviations that vary its magnitude, by these `factors` (cause,) [N per unit]
    """

    part: int
    point: Vector
    vector: Vector
    columns: tuple[int, ...] = ()
    factors: tuple[float, ...] = ()


@dataclass(frozen=True, eq=False)
class BilateralLocators:
    """The rigid two-sided locators of a mover: bilateral constraints. Parts are given by their positions in the group.

    part         the mover
    owners       the part that each locator is on: the mover, or parts of its joint
    parent       the part that the mover is located on, or None for the ground
    points       nominal point (3,) [mm] of each locator
    directions   direction (3,) of each locator
    stiffness    stiffness [N/mm] of each locator
    is_placed    whether the locators fix the mover where it was placed, and not by their deviations
    """

    part: int
    owners: tuple[int, ...]
    parent: int | None
    points: Sequence[Vector]
    directions: Sequence[Vector]
    stiffness: Sequence[Number]
    is_placed: bool


@dataclass(frozen=True, eq=False)
class Group:
    """Parts that contact couples to each other, and the fixed parts that they touch.

    parts, pairs     indices into the nominal model's
    free             indices of the movers among all parts of the model
    mobilities       one per part of `parts`
    sides            sides of pairs in the objective, in the order of the Function's moments
    loads            forces on the parts
    bilateral        bilateral locators of the movers
    has_springs      whether any contact point is compliant
    length           root mean square distance of the contact points from their centroid [mm]
    count            number of points on all sides
    """

    parts: tuple[int, ...]
    pairs: tuple[int, ...]
    free: tuple[int, ...]
    mobilities: tuple[Mobility, ...]
    sides: tuple[Side, ...]
    loads: tuple[Load, ...]
    bilateral: tuple[BilateralLocators, ...]
    has_springs: bool
    length: Number
    count: Number

    def position(self, part: int) -> int:
        """Return the position of a part in `parts`."""
        return self.parts.index(part)


def curved_pairs(nominal: Nominal, group: Group) -> list[int]:
    """Return the positions of a group's pairs whose curved reference face is represented by fixed planes."""
    pairs = [nominal.pairs[index] for index in group.pairs]
    return [k for k, pair in enumerate(pairs) if pair.curvature > 0]


def contact_groups(nominal: Nominal, method: Method) -> list[Group]:
    """Return the groups of parts that contact couples. Parts that share only a fixed neighbour are in different groups.

    In the exact resolution contact points are weighted by the areas that they represent, and all points of a pair together
    count as its faces do, by their areas; in the paper each point counts once.
    """
    chains = [part.movers for part in nominal.parts]
    clusters: list[set[int]] = []
    for pair in nominal.pairs:
        joined = _movers_of(pair, chains)
        for cluster in [c for c in clusters if c & joined]:
            clusters.remove(cluster)
            joined |= cluster
        clusters.append(joined)
    return [_group(nominal, chains, tuple(sorted(cluster)), method) for cluster in clusters]


def _movers_of(pair: ContactPoints, chains: Sequence[tuple[int, ...]]) -> set[int]:
    return {mover for part in (pair.moving, pair.reference) if part is not None for mover in chains[part]}


def _group(nominal: Nominal, chains: Sequence[tuple[int, ...]], free: tuple[int, ...], method: Method) -> Group:
    members = [(index, pair) for index, pair in enumerate(nominal.pairs) if _movers_of(pair, chains) & set(free)]
    moved = {part for part, chain in enumerate(chains) if set(chain) & set(free)}
    neighbours = {part for _, pair in members for part in (pair.moving, pair.reference)} | {
        nominal.parts[part].parent for part in free
    }
    parts = tuple(sorted(moved | {part for part in neighbours if part is not None}))
    points: dict[int, list[np.ndarray]] = {part: [] for part in parts}
    for _, pair in members:
        points[pair.moving].append(pair.P_m)
        if pair.reference is not None:
            points[pair.reference].append(pair.P_r)
    moving_points = np.vstack([pair.P_m for _, pair in members])
    centre = {part: np.vstack(_points_near(part, points, chains, free)).mean(axis=0) for part in parts}
    references = {pair.reference for _, pair in members}
    spread = float(np.sqrt(((moving_points - moving_points.mean(axis=0)) ** 2).sum(axis=1).mean()))
    length = spread or float(nominal.parts[members[0][1].moving].mesh.scale)
    ball = BALL_SHARE * length
    density = _points_per_area([pair for _, pair in members]) if method.counts_faces else 1.0
    sides = [
        _side(position, pair, parts.index(part), of_moving, method, density, centre[part], ball)
        for position, (_, pair) in enumerate(members)
        for part, of_moving in ((pair.moving, True), (pair.reference, False))
        if part is not None and chains[part]
    ]
    bilateral = [_bilateral_locators(nominal, part, parts) for part in free if nominal.parts[part].locators.exact.any()]
    return Group(
        parts=parts,
        pairs=tuple(index for index, _ in members),
        free=free,
        mobilities=tuple(
            Mobility(tuple(free.index(mover) for mover in chains[part]), centre[part], part in references) for part in parts
        ),
        sides=tuple(sides),
        loads=tuple(_loads(nominal, parts, [part for part in parts if chains[part]])),
        bilateral=tuple(bilateral),
        has_springs=any(pair.is_springy for _, pair in members),
        length=length,
        count=sum(len(side.points) for side in sides),
    )


def _loads(nominal: Nominal, parts: tuple[int, ...], moved: Sequence[int]) -> Iterator[Load]:
    """Yield the declared forces that act on parts which contact can move."""
    for force in nominal.assembly.forces:
        part = nominal.part_index(force.at.part, force.station)
        if part in moved:
            causes = [cause for cause in nominal.assembly.variables if force.name in cause.loads]
            columns = tuple(nominal.contributors.index(cause.name) for cause in causes)
            factors = tuple(float(cause.loads[force.name]) for cause in causes)
            yield Load(parts.index(part), nominal.position(force.at), np.array(force.vector), columns, factors)


def _bilateral_locators(nominal: Nominal, part: int, parts: tuple[int, ...]) -> BilateralLocators:
    entry = nominal.parts[part]
    locators, exact = entry.locators, np.flatnonzero(entry.locators.exact)
    owners = entry.owners or (part,) * len(locators)
    return BilateralLocators(
        part=parts.index(part),
        owners=tuple(parts.index(owners[k]) for k in exact),
        parent=None if entry.parent is None else parts.index(entry.parent),
        points=[*locators.points[exact]],
        directions=[*locators.directions[exact]],
        stiffness=locators.stiffness[exact].tolist(),
        is_placed=locators.placing != FIRST_ORDER,
    )


def _points_near(
    part: int, points: Mapping[int, list[np.ndarray]], chains: Sequence[tuple[int, ...]], free: tuple[int, ...]
) -> list[np.ndarray]:
    """Return contact points of a part; without any, points of the last part that moves it, or of its joint."""
    mover = (chains[part] or free)[-1]
    return points[part] or points[mover] or [P for other in points if chains[other] == chains[mover] for P in points[other]]


def _area(pair: ContactPoints) -> float:
    """Return the area [mm^2] of the moving face that counts; 0 without faces, or if no part is opposite to the other face."""
    return 0.0 if pair.moving_region is None else pair.moving_region.area


def _points_per_area(pairs: Sequence[ContactPoints]) -> float:
    """Return the number of contact points per area [1/mm^2] of the faces that count, in all pairs that have such faces.

    The product of this density and an area is about a number of points, so that a point of a pair without such faces counts as
    a point of the others. It is 1 if no pair has them.
    """
    counted = [(len(pair.P_m), _area(pair)) for pair in pairs if _area(pair) > 0]
    return sum(count for count, _ in counted) / sum(area for _, area in counted) if counted else 1.0


def _side(
    position: int,
    pair: ContactPoints,
    part: int,
    of_moving: bool,
    method: Method,
    density: float,
    centre: np.ndarray,
    radius: float,
) -> Side:
    """Return one side of a pair; in the regularization its contact points are balls of a radius [mm].

    density   contact points of the group per area [1/mm^2] of the faces that count
    """
    counted, points = pair.counted(of_moving=of_moving), pair.P_m if of_moving else pair.P_r
    area, face_moments = _area(pair) if method.counts_faces else 0.0, None
    if area > 0 and pair.samples_faces and (region := pair.moving_region if of_moving else pair.reference_region) is not None:
        face_moments = moment_table(region.places, centre) @ region.shares * density
    # Where a face counts, its points do not: their weights take long to compute.
    weights = pair.weights if method.is_exact and face_moments is None else np.ones(len(points))
    weights = weights * (area * density / len(points)) if area > 0 else weights
    all_moments = (moment_table(points, centre) * weights).sum(axis=1) if face_moments is None else face_moments.copy()
    all_moments[[4, 7, 9]] += all_moments[0] * radius**2
    return Side(position, part, of_moving, *counted, weights, centre, face_moments, density, all_moments)
