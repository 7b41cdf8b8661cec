"""Checks of elastic parts: bending beyond the theory, and under load, with figures, laws of elasticity and finer meshes."""

import warnings
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.compilation import Program
from tolcontact.compilation.other_flexibility import STIFFER, overheld, stiffer, with_flexibility
from tolcontact.declaration import Measure
from tolcontact.elasticity import ElasticBody
from tolcontact.errors import GeometryFault, NominalWarning
from tolcontact.mechanics.flexibility import Bodies, PartFlexibility, elastic_bodies, part_flexibilities
from tolcontact.plausibility.trial_draws import TrialDraws, spread
from tolcontact.simulation import Block, simulate_block
from tolcontact.vocabulary import CERTIFIED, CORRECTED, Status

DRAWS = 8  # under load, and the nominal assembly
MAX_COLUMNS = 32  # unit loads of which reciprocity is tested
ACCURACY = 1e-6  # relative, of the laws: rounding is far below, and matrices in single precision pass
LIMIT_ACCURACY = 1e-6  # [mm], of poses with STIFFER times the stiffness, and with its square
EDGE_SHARES, DIMENSIONS = (0.5, 0.7), 3  # edges of the finer mesh by those of the mesh
MAX_NODES = 40_000  # of the finer mesh, so that a check takes a minute at most
ORDER = 2  # of convergence: displacements of quadratic tetrahedra converge with order 2 to 4
MAX_SHARE = 0.05  # of a tolerance, or of 6 sigma: the uncertainty of a measurement by the mesh
MAX_LISTED = 12
MAX_BENDING = 0.1  # of the size of a part: the stiffness of a part that bends further is not that of its undeformed shape


def large_bending(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each elastic part that bends too far in the nominal assembly for a theory of small displacements."""
    bending, parts = draws.program.bending, draws.program.nominal.parts
    for index, bent in bending.parts.items() if bending else ():
        bend, size = bent.largest_displacement(draws.nominally_resolved.load[0]), float(parts[index].mesh.scale)
        if bend > MAX_BENDING * size:
            yield (
                f"{parts[index].part.designation}: it bends by {bend:.3g} mm in the nominal assembly, and is {size:.3g} mm "
                "large, beyond a theory of small displacements; check its forces, its supports, and its modulus or "
                "the units of its stiffness"
            )


def unresolved_nominal(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence if contact of elastic parts is not resolved in the nominal assembly."""
    if draws.program.bending and (status := Status(draws.nominally_resolved.status[0])) not in CERTIFIED:
        yield (
            f"the nominal assembly, which has elastic parts, is {status.name.lower()}; check that locators and contact hold "
            "each part against its forces, and that stops leave a place for it"
        )


@dataclass(frozen=True, eq=False)
class LoadedPart:
    """An elastic part, in one station, under the reactions and forces of some draws.

    index    the part in the model, see Nominal.parts
    points, directions   where its loads act in the nominal assembly [mm], and the unit forces on it (load, 3)
    draws    deviations of locators alone, the nominal assembly first
    """

    program: Program
    index: int
    body: ElasticBody
    flexibility: PartFlexibility
    draws: Block

    @property
    def name(self) -> str:
        """Its name in a sentence."""
        part = self.program.nominal.parts[self.index]
        return f'part "{part.name}"{f" in station {part.station}" * bool(part.station)}'

    @property
    def sides(self) -> list[tuple[int, int, float]]:
        """The pair, the point, and the sign of the normal of each load on this part."""
        loads, pairs = self.program.nominal.loads[self.flexibility.loads].tolist(), self.program.nominal.pairs
        return [(k, point, 1.0 if pairs[k].moving == self.index else -1.0) for k, point in loads]

    @cached_property
    def unit_loads(self) -> np.ndarray:
        """The nodal forces (3 node, load) of its loads."""
        pairs = self.program.nominal.pairs
        P = [(pairs[k].P_m if sign > 0 else pairs[k].P_r)[point] for k, point, sign in self.sides]
        n = [sign * pairs[k].n_r[point] for k, point, sign in self.sides]
        return self._spread(np.reshape(P, (-1, 3)), np.reshape(n, (-1, 3)))

    @cached_property
    def constant_forces(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """The place (3,), force (3,) and nodal forces (3 node,) of each constant force, and of its weight."""
        nominal = self.program.nominal
        forces = [
            (nominal.position(force.at), np.array(force.vector, dtype=float))
            for force in nominal.assembly.forces
            if nominal.part_index(force.at.part, force.station) == self.index
        ]
        acting = [(at, vector, self._spread(at[None], vector[None])[:, 0]) for at, vector in forces]
        if nominal.assembly.acceleration is not None:
            part, g = nominal.parts[self.index], np.array(nominal.assembly.acceleration)
            centre, (R, _) = self.body.shares @ self.body.nodes, part.placement
            acting.append((part.placed(centre), self.body.mass * g, self.body.weight(g @ R)))
        return acting

    def _spread(self, P: np.ndarray, n: np.ndarray) -> np.ndarray:
        part = self.program.nominal.parts[self.index]
        (R, t), elastic = part.placement, part.part.elasticity
        return self.body.spread((P - t) @ R, n @ R, None if elastic is None else elastic.pad).toarray()

    @cached_property
    def largest(self) -> int:
        """The draw with the largest reactions."""
        return int(np.abs(self.draws.load[:, self.flexibility.loads]).sum(axis=1).argmax())

    @cached_property
    def nodal_forces(self) -> Float[Array, " force"]:
        """All nodal forces (3 node,) [N] in that draw."""
        forces = self.unit_loads @ self.draws.load[self.largest, self.flexibility.loads]
        return np.asarray(forces + sum(nodal for _, _, nodal in self.constant_forces))

    @cached_property
    def displacements(self) -> Float[Array, " force"]:
        """The displacements (3 node,) [mm] under them, solved at once."""
        return self.body.response(self.nodal_forces[:, None])[:, 0]

    @cached_property
    def unbalanced(self) -> tuple[float, float]:
        """The largest sums of the forces on it and of their moments, by all forces, and by these times its size [1]."""
        X, pairs, load = self.draws.poses[:, CORRECTED], self.program.nominal.pairs, self.draws.load
        at, acting = [np.zeros((len(X), 0, 3))], [np.zeros((len(X), 0, 3))]
        for of_part, (k, point, sign) in zip(self.flexibility.loads, self.sides, strict=True):
            n = pairs[k].n_r[point]
            if pairs[k].reference is not None:
                n = pose.rotation(X[:, pairs[k].reference]) @ n
            at.append(pose.apply(X[:, pairs[k].moving], pairs[k].P_m[[point]]))
            acting.append((sign * load[:, of_part, None] * n)[:, None])
        for place, force, _ in self.constant_forces:
            at.append(pose.apply(X[:, self.index], place[None]))
            acting.append(np.tile(force, (len(X), 1, 1)))
        f, x = np.concatenate(acting, axis=1), np.concatenate(at, axis=1)
        x = x - x.mean(axis=1, keepdims=True)
        constant = sum(float(np.linalg.norm(force)) for _, force, _ in self.constant_forces)
        most = constant + float(np.abs(load).sum(axis=1).max(initial=0))
        force, moment = (np.linalg.norm(total, axis=1).max() for total in (f.sum(axis=1), np.cross(x, f).sum(axis=1)))
        size = self.program.nominal.parts[self.index].mesh.scale
        return (float(force / most), float(moment / most / size)) if most else (0.0, 0.0)


def _betti(part: LoadedPart) -> float:
    loads = part.unit_loads[:, :: max(1, -(-part.unit_loads.shape[1] // MAX_COLUMNS))]
    if not loads.shape[1]:
        return 0.0
    G = loads.T @ part.body.response(loads)
    return float(np.abs(G - G.T).max() / np.abs(G).max())


def _rigid_forces(part: LoadedPart) -> float:
    R, _ = part.body.rigid
    other = np.where(np.arange(len(R)) * 0.6180339887 % 1 < 0.5, -1.0, 1.0)  # neighbours move apart
    return float(np.abs(part.body.restoring(R)).max() / np.abs(part.body.restoring(other[:, None])).max())


def _energy(part: LoadedPart) -> float:
    u, work = part.displacements, float(part.displacements @ part.nodal_forces)
    return abs(float(u @ part.body.restoring(u[:, None])[:, 0]) - work) / abs(work) if work else 0.0


def _superposition(part: LoadedPart) -> float:
    bent, loads = part.flexibility, part.draws.load[part.largest, part.flexibility.loads]
    summed, at_once = bent.C @ loads + bent.opening, part.unit_loads.T @ part.displacements
    return float(np.abs(summed - at_once).max() / np.abs(at_once).max()) if np.abs(at_once).max(initial=0) else 0.0


class Law(NamedTuple):
    """A law of linear elasticity: its `error` of a part is relative to what `unit` names, and `remedy` mends a large one."""

    name: str
    error: Callable[[LoadedPart], float]
    unit: str
    remedy: str


LAWS = (
    Law("balance of forces", lambda part: part.unbalanced[0], "all forces", 'choose another solver, such as "graph"'),
    Law("balance of moments", lambda part: part.unbalanced[1], "forces by size", 'choose another solver, such as "graph"'),
    Law("reciprocity (Betti)", _betti, "the flexibility", "export its stiffness again, or mend its shape"),
    Law("rigid motions (K R = 0)", _rigid_forces, "the stiffness", "export its stiffness again, without supports"),
    Law("energy (u'K u = f'u)", _energy, "the work", "export its stiffness with more digits, or mend its shape"),
    Law("superposition", _superposition, "the displacement", "export its stiffness with more digits, or mend its shape"),
)


def elastic_remarks(program: Program) -> Iterator[str]:
    """Yield what the checks of elastic parts find, with figures; a NominalWarning names what is doubtful, and the remedy.

    Bodies are solved again, and meshes made finer once, so this may take a minute.
    """
    if program.bending is None:
        return
    draws, bodies = TrialDraws.of(program), elastic_bodies(program.nominal)
    deviations = np.concatenate([np.zeros_like(draws.deviations[:1]), draws.deviations[:DRAWS]])
    of_locators = deviations.copy()
    of_locators[:, len(program.nominal.locators) :] = 0  # deviating faces tilt normals
    yield from law_remarks(loaded_parts(program, bodies, simulate_block(program, of_locators)))
    if names := overheld(program):
        yield f"rigid limit: none, since {names} hold parts by more than six equations: rigid ones would not fit"
    else:
        yield limit_remark(*(simulate_block(stiffer(program, factor), of_locators) for factor in (STIFFER, STIFFER**2)))
    yield from mesh_remarks(draws, bodies, deviations)


def _doubt(sentence: str) -> None:
    warnings.warn(f"[bending] {sentence}", NominalWarning, stacklevel=4)


def loaded_parts(program: Program, bodies: Bodies, draws: Block) -> list[LoadedPart]:
    """Return the elastic parts of a program, in each of their stations, under the loads of these draws."""
    bent, parts = program.bending.parts if program.bending else {}, program.nominal.parts
    return [LoadedPart(program, index, bodies[parts[index].part], flexibility, draws) for index, flexibility in bent.items()]


def law_remarks(parts: Sequence[LoadedPart]) -> Iterator[str]:
    """Yield how well the parts obey each of LAWS."""
    for law in LAWS:
        errors = [law.error(part) for part in parts]
        worst = int(np.argmax(errors))
        yield f"{law.name}: within {errors[worst]:.1e} of {law.unit}, {parts[worst].name}"
        if not errors[worst] <= ACCURACY:
            _doubt(f"{parts[worst].name}: {law.name} holds to {errors[worst]:.1e} of {law.unit} only; {law.remedy}")


def limit_remark(stiff: Block, stiffest: Block) -> str:
    """Return how far parts of STIFFER times the stiffness are from rigid ones, with its square."""
    is_certified = np.isin(stiff.status, CERTIFIED) & np.isin(stiffest.status, CERTIFIED)
    distance = float(np.abs(stiff.poses - stiffest.poses)[is_certified].max(initial=0))
    if not distance <= LIMIT_ACCURACY or not is_certified.all():
        _doubt(
            f"stiffer and stiffer parts are not placed as rigid ones: {distance:.1e} mm apart, "
            f"{np.count_nonzero(~is_certified)} of {len(stiff)} draws not resolved; look at locators that hold the same"
        )
    return f"rigid limit: poses differ by {distance:.1e} mm at {STIFFER:.0e} times the stiffness, and at {STIFFER**2:.0e} times"


def mesh_remarks(draws: TrialDraws, bodies: Bodies, deviations: Float[Array, "n contributor"]) -> Iterator[str]:
    """Yield how much a finer mesh of the parts changes the measurements, which is their uncertainty."""
    program, finer, largest_share = draws.program, dict(bodies), 0.0
    for part, body in bodies.items():
        share = next((share for share in EDGE_SHARES if len(body.nodes) / share**DIMENSIONS <= MAX_NODES), 1.0)
        try:
            if body.finer is None:
                reason = "none, its stiffness is a file; refine the mesh in the program that wrote it"
            elif share == 1.0:
                reason = f"none, it has {len(body.nodes)} nodes, and a finer one would have more than {MAX_NODES}"
            else:
                finer[part], largest_share = body.finer(share), max(share, largest_share)
                reason = f"{len(finer[part].nodes)} nodes in place of {len(body.nodes)}"
        except GeometryFault as fault:
            reason = f"none, {fault}"
        yield f"finer mesh of part {part.name}: {reason}"
    if not largest_share:
        return
    refined = with_flexibility(program, part_flexibilities(program.nominal, finer))
    before, after = (simulate_block(each, deviations).measured[:, CORRECTED] for each in (program, refined))
    errors = np.abs(after - before).max(axis=0) / (1 - largest_share**ORDER)
    yield from _uncertainties(draws, errors)


def _uncertainties(draws: TrialDraws, errors: Float[Array, " measure"]) -> Iterator[str]:
    """Yield the uncertainty of each measurement by the mesh, its largest share of a tolerance or of 6 sigma first."""
    program = draws.program
    rows: list[tuple[float, Measure, str]] = []
    for k, (measure, error) in enumerate(zip(program.nominal.measures, errors.tolist(), strict=True)):
        limits = program.limits(k)
        width, of = limits.upper - limits.lower, "its tolerance"
        if not np.isfinite(width):
            width, of = 6 * float(spread(draws.resolved.measured[:, CORRECTED, k])), "its 6 sigma"
        share = error / width if width > program.accuracies[k] else 0.0
        rows.append((share, measure, f"{error:.2g} {measure.units} by the mesh" + f", {share:.2g} of {of}" * (share > 0)))
    rows.sort(key=lambda row: -row[0])
    for share, measure, stated in rows[:MAX_LISTED]:
        yield f"{measure.name}: uncertain by {stated}"
        if not share <= MAX_SHARE:
            _doubt(
                f"{measure.designation}: it is uncertain by {stated} of elastic parts (at most {MAX_SHARE:g} is expected); "
                "give a smaller element_size, or import a stiffness matrix of shells"
            )
    if len(rows) > MAX_LISTED:
        yield f"{len(rows) - MAX_LISTED} more measurements: uncertain by no larger share"
