"""The flexibility of elastic parts at the rows of a contact QP: gaps open by opening + C l for the reactions l of all rows.

Row i pushes its moving part at P_m along n_r, and its reference part at P_r along -n_r. For the unit forces N of all rows on a
part, and its constant forces F, C is the sum over the parts of N'GN, with the compliance of springs on the diagonal, and the
opening the sum of N'GF. G is the flexibility of the free part: displacements are counted from its mean rigid motion, which is
its pose.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import NamedTuple

import casadi as ca
import numpy as np
from scipy import linalg, sparse

from tolcontact import poses as pose
from tolcontact.arrays import Array, Bool, Float, Int
from tolcontact.declaration import Mesh, Part, Point
from tolcontact.discretization import Nominal, NominalPart, Weld
from tolcontact.elasticity import ElasticBody, imported_body, meshed_body, responses
from tolcontact.errors import Faults, GeometryFault, designation
from tolcontact.geometry.files import FROM_PRODUCT
from tolcontact.mechanics.groups import Group, Load
from tolcontact.mechanics.opening_kernel import add_openings

NULL = 1e-14  # of the largest eigenvalue of C, scaled to a unit diagonal: smaller ones are rounding
SAME = 1e-12  # of the largest eigenvalue: of fewer motions at two-sided locators than there are locators

Bodies = Mapping[Part, ElasticBody]


@dataclass(frozen=True, eq=False)
class Flexibility:
    """The flexibility of the rows of a group.

    C         (row, row) [mm/N]; rows of rigid pairs are zero
    opening   (row,) [mm] by the constant forces
    holds     (row,): whether it is a two-sided locator, whose gap is zero
    loads     (load,) the loads of the model that are reactions of rows, see Nominal.loads; and these `load_rows` (load,)
    """

    C: Float[Array, "row row"]
    opening: Float[Array, " row"]
    holds: Bool[Array, " row"]
    loads: Int[Array, " load"]
    load_rows: Int[Array, " load"]

    @property
    def rows(self) -> Int[Array, " k"]:
        """The rows that open under load."""
        return np.flatnonzero(np.diag(self.C))

    @cached_property
    def factor(self) -> Float[Array, "k k"]:
        """The lower triangular L with L L' = C of `rows`; C may be singular, as for points that bend nothing together."""
        C = self.C[np.ix_(self.rows, self.rows)]
        scale = np.sqrt(np.diag(C))
        values, vectors = np.linalg.eigh(C / np.outer(scale, scale))
        values[values < NULL * values[-1]] = 0
        lower = linalg.qr((vectors * np.sqrt(values)).T, mode="r")[0].T
        return np.asarray(scale[:, None] * lower * np.where(np.diag(lower) < 0, -1.0, 1.0))

    def openings(self, reactions: Float[Array, "realization row"]) -> Float[Array, "realization row"]:
        """Return the openings (realization, row) [mm] under reactions [N] of the rows, summed up in a fixed order."""
        return self._opened(np.tile(self.opening, (len(reactions), 1)), reactions)

    def bent(self, reactions: Float[Array, "realization row"]) -> Float[Array, "realization row"]:
        """Return C l (realization, row) [mm]: the openings by reactions [N] of the rows, without constant forces."""
        return self._opened(np.zeros(reactions.shape), reactions)

    def _opened(self, openings: np.ndarray, reactions: np.ndarray) -> np.ndarray:
        add_openings(self.C, np.ascontiguousarray(reactions), openings)
        return openings


class PartFlexibility(NamedTuple):
    """The flexibility of one elastic part of a group.

    part       its index in the model
    nodes      their number
    mass       [kg], NaN if it is unknown
    loads      (k,) the loads of the model that act on it, see Nominal.loads
    C          (k, k) [mm/N]
    opening    (k,) [mm] by the constant forces
    points     (point, 3) nominal places [mm] whose displacements are measured
    moved      (point, 3, k + 1) their displacements per load [mm/N], and last by the constant forces [mm]
    surface    (vertex, 3, k + 1) the same of the vertices of its surface, in the nominal assembly frame; none of joined parts
    """

    part: int
    nodes: int
    mass: float
    loads: Int[Array, " k"]
    C: Float[Array, "k k"]
    opening: Float[Array, " k"]
    points: Float[Array, "point 3"]
    moved: Float[Array, "point 3 load"]
    surface: Float[Array, "vertex 3 load"]

    def place(self, point: Float[Array, " 3"]) -> int:
        """Return the index of a measured point."""
        return int(np.flatnonzero((self.points == point).all(axis=1))[0])

    def largest_displacement(self, loads: Float[Array, " load"]) -> float:
        """Return the largest displacement [mm] under loads [N] and the constant forces, where something acts or is measured."""
        own = loads[self.loads]
        return float(
            max(
                np.abs(self.C @ own + self.opening).max(initial=0),
                np.linalg.norm(self.moved @ [*own, 1], axis=1).max(initial=0),
            )
        )


class Bending:
    """The elastic displacements of measured points, as expressions of the loads.

    loads   (load, 1) [N]: reactions of all contact points between elastic parts
    parts   the elastic parts, by their index in the model
    """

    def __init__(self, nominal: Nominal, parts: Iterable[PartFlexibility]) -> None:
        self.loads = ca.SX.sym("loads", len(nominal.loads))
        self.parts = {part.part: part for part in parts}

    def displacement(self, part: int, position: Float[Array, " 3"]) -> ca.SX:
        """Return the displacement (3, 1) [mm], in the nominal assembly frame, of a point of a part; zero if it is rigid."""
        if part not in self.parts:
            return ca.SX.zeros(3)
        bent = self.parts[part]
        return ca.DM(bent.moved[bent.place(position)]) @ ca.vertcat(self.loads[bent.loads.tolist()], 1)

    def weld_gaps(self, weld: Weld, poses: Float[Array, "n part 12"], loads: Float[Array, "n load"]) -> Float[Array, "n row"]:
        """Return the gaps (n, row) [mm] of a weld, at poses of the parts of its station and under loads [N]."""
        X_RM = pose.relative(poses[:, weld.moving], poses[:, weld.reference])
        gaps = ((pose.apply(X_RM, weld.P_m) - weld.P_r) * weld.n_r).sum(axis=2)
        for index, P, sign in ((weld.moving, weld.P_m, 1.0), (weld.reference, weld.P_r, -1.0)):
            if index in self.parts:
                bent = self.parts[index]
                for row, (point, n) in enumerate(zip(P, sign * weld.n_r, strict=True)):
                    by_load = n @ bent.moved[bent.place(point)]
                    gaps[:, row] += by_load[-1]
                    for load, share in zip(bent.loads, by_load, strict=False):  # in a fixed order
                        gaps[:, row] += loads[:, load] * share
        return np.asarray(gaps)


def elastic_bodies(nominal: Nominal) -> Bodies:
    """Return the bodies of the elastic parts. Raises ModelError, with a sentence for each part whose body cannot be made."""
    faults, parts = Faults(), {part.part: part for part in nominal.parts if part.part.elasticity is not None}
    bodies = {part: faults.attempt(designation("part", part), _body, entry) for part, entry in parts.items()}
    faults.refuse(nominal.assembly.name)
    return {part: body for part, body in bodies.items() if body is not None}


def _body(entry: NominalPart) -> ElasticBody:
    elastic, mesh, geometry = entry.part.elasticity, entry.mesh, entry.part.geometry
    assert elastic is not None
    if elastic.stiffness is not None and elastic.nodes is not None:
        return imported_body(Path(elastic.stiffness), Path(elastic.nodes), mesh.vertices, mesh.faces)
    assert elastic.E is not None and elastic.nu is not None
    R, _ = mesh.metadata.get(FROM_PRODUCT, (np.eye(3), None))
    is_mirrored = np.linalg.det(R) < 0  # which is no solid of its file
    step = geometry.source if isinstance(geometry, Mesh) and geometry.is_step and not is_mirrored else None
    return meshed_body(mesh.vertices, mesh.faces, elastic.E, elastic.nu, elastic.density, step, elastic.element_size)


def with_weights(group: Group, nominal: Nominal, bodies: Bodies) -> Group:
    """Return the group with the weights of its elastic parts among its loads. Raises ModelError if a mass is unknown."""
    if nominal.assembly.acceleration is None:
        return group
    parts = ((position, nominal.parts[index]) for position, index in enumerate(group.parts))
    faults = Faults()
    weights = [
        faults.attempt(designation("part", part.part), _weight, position, part, bodies[part.part], nominal)
        for position, part in parts
        if part.part in bodies
    ]
    faults.refuse(nominal.assembly.name)
    return replace(group, loads=(*group.loads, *(weight for weight in weights if weight is not None)))


def _weight(position: int, part: NominalPart, body: ElasticBody, nominal: Nominal) -> Load:
    """Return the weight of a part at its centre of mass, so that moments are right however contact turns the part."""
    R, _ = part.placement
    return Load(
        position, part.placed(body.shares @ body.nodes), R @ _nodal_weight(part, body, nominal).reshape(-1, 3).sum(axis=0)
    )


def _nodal_weight(part: NominalPart, body: ElasticBody, nominal: Nominal) -> np.ndarray:
    R, _ = part.placement
    return body.weight(np.array(nominal.assembly.acceleration) @ R)


def part_flexibilities(nominal: Nominal, bodies: Bodies) -> list[PartFlexibility]:
    """Return the flexibility of each elastic part, in each of its stations.

    Raises ModelError for a point where no force can act on its part.
    """
    faults = Faults()
    results = [
        faults.attempt(designation("part", part.part), _part_flexibility, nominal, index, bodies[part.part])
        for index, part in enumerate(nominal.parts)
        if part.part in bodies
    ]
    faults.refuse(nominal.assembly.name)
    return results


def _part_flexibility(nominal: Nominal, index: int, body: ElasticBody) -> PartFlexibility:
    part, acting = nominal.parts[index], [(np.zeros(0, dtype=int), *np.zeros((2, 0, 3)))]
    for k in np.unique(nominal.loads[:, 0]):
        pair, loads_of_pair = nominal.pairs[k], np.flatnonzero(nominal.loads[:, 0] == k)
        for side, P, sign in ((pair.moving, pair.P_m, 1.0), (pair.reference, pair.P_r, -1.0)):
            if side == index:
                acting.append((loads_of_pair, P, sign * pair.n_r))
    loads_on_part, P, n = (np.concatenate(values) for values in zip(*acting, strict=True))
    points = _measured_points(nominal, index)
    loads = [_spread(part, body, P, n), _spread(part, body, np.repeat(points, 3, axis=0), np.tile(np.eye(3), (len(points), 1)))]
    constant = np.zeros(loads[0].shape[0])
    for force in nominal.assembly.forces:
        if nominal.part_index(force.at.part, force.station) == index:
            at, vector = nominal.position(force.at), np.array(force.vector, dtype=float)
            constant += _spread(part, body, at[None], vector[None]).toarray()[:, 0]
    if nominal.assembly.acceleration is not None:
        constant += _nodal_weight(part, body, nominal)
    (R, t), k = part.placement, len(P)
    shown = (part.vertices - t) @ R if index in nominal.last_indices else np.zeros((0, 3))
    G, surface = responses(body, sparse.hstack([*loads, sparse.csc_array(constant[:, None])], format="csc"), shown)
    surface = np.einsum("ij,vjk->vik", R, surface[:, :, [*range(k), -1]])
    _check_holding(nominal, index, loads_on_part, P, n, G[:k, :k])
    moved = G[k:-1][:, [*range(k), -1]].reshape(len(points), 3, k + 1)
    return PartFlexibility(index, len(body.nodes), body.mass, loads_on_part, G[:k, :k], G[:k, -1], points, moved, surface)


def _check_holding(nominal: Nominal, index: int, loads: np.ndarray, P: np.ndarray, n: np.ndarray, C: np.ndarray) -> None:
    """Raise GeometryFault for two-sided locators that contradict each other however their part moves and bends."""
    pairs = [nominal.pairs[k] for k in nominal.loads[loads, 0]]
    held = np.flatnonzero(
        [p.holds and p.stiffness is not None and np.isinf(p.stiffness).all() and p.reference is None for p in pairs]
    )
    if not held.size:
        return
    arms = P[held] - P[held].mean(axis=0)
    turns = np.cross(arms, n[held]) / (np.linalg.norm(arms, axis=1).max() or 1.0)
    moves, bends = np.hstack([n[held], turns]), C[np.ix_(held, held)]
    values, vectors = np.linalg.eigh(moves @ moves.T + bends / (np.abs(bends).max() or 1.0))
    if values[0] < SAME * values[-1]:
        share = np.abs(vectors[:, 0])
        names = ", ".join(f'"{pairs[k].name}"' for k in held[share > 1e-3 * share.max()])
        raise GeometryFault(
            f"its two-sided locators {names} contradict each other if they deviate, however it bends; leave one of them out, "
            "place them at different points, or make one of them one_sided=True"
        )


def _spread(part: NominalPart, body: ElasticBody, P: np.ndarray, n: np.ndarray) -> sparse.csc_array:
    """Return the nodal loads of forces n (load, 3) at points P (load, 3) of the nominal assembly."""
    (R, t), elastic = part.placement, part.part.elasticity
    return body.spread((P - t) @ R, n @ R, None if elastic is None else elastic.pad)


def _measured_points(nominal: Nominal, index: int) -> np.ndarray:
    """Return the points (point, 3) of a part that measures or its welds refer to, in the nominal assembly."""
    points = [
        model.position(point)
        for model in nominal.scenes or (nominal,)
        for measure in model.measures
        for point in (measure.of, measure.to)
        if isinstance(point, Point) and model.part_index(point.part) == index
    ]
    for weld in nominal.welds:
        points += [*(weld.P_m if weld.moving == index else ()), *(weld.P_r if weld.reference == index else ())]
    return np.unique(np.array(points).reshape(-1, 3), axis=0)


def group_flexibility(
    nominal: Nominal, group: Group, row_counts: Sequence[int], parts: Sequence[PartFlexibility]
) -> Flexibility | None:
    """Return the flexibility of the rows of a group, whose pairs have `row_counts` rows; None without elastic parts."""
    pairs, starts = [nominal.pairs[k] for k in group.pairs], np.cumsum([0, *row_counts])
    if not any(pair.elastic for pair in pairs):
        return None
    start_of_pair = np.full(len(nominal.pairs), -1)
    start_of_pair[list(group.pairs)] = starts[:-1]
    loads = np.flatnonzero(start_of_pair[nominal.loads[:, 0]] >= 0)
    row_of_load = start_of_pair[nominal.loads[:, 0]] + nominal.loads[:, 1]
    C, opening = np.zeros((starts[-1], starts[-1])), np.zeros(starts[-1])
    for part in parts:
        if part.part in group.parts:
            rows = row_of_load[part.loads]
            C[np.ix_(rows, rows)] += part.C
            opening[rows] += part.opening
    compliance = [
        np.zeros(count) if pair.stiffness is None else 1 / pair.stiffness for count, pair in zip(row_counts, pairs, strict=True)
    ]
    holds = np.repeat([pair.holds for pair in pairs], row_counts)
    return Flexibility(C + np.diag(np.concatenate(compliance)), opening, holds, loads, row_of_load[loads])
