"""A model to first order at the nominal assembly, as numbers: for bounds, and for what designers call sensitivities."""

from dataclasses import dataclass

import numpy as np

from tolcontact import poses as pose
from tolcontact.compilation import Program
from tolcontact.mechanics import Group

STEP = 1e-4  # mm, and rad times the length of a group: steps of central differences; what is odd in them cancels


@dataclass(frozen=True, eq=False)
class LinearModel:
    """Measures and gaps for deviations d (contributor,), and a motion y of the free parts from where d places them.

    A motion is (dt, L w) of each free part: a shift of its middle [mm], and a turn times the length L of its group [mm].

    measures         (measure,) nominally
    by_deviations    (measure, contributor)
    by_motion        (measure, freedom)
    gaps             (row,) nominally: of the contact points that can be the deepest, of pairs of flat faces
    gaps_by_deviations, gaps_by_motion   (row, contributor), (row, freedom)
    held             (row, freedom): what two-sided locators hold at 0, if the objective is seating
    displacements    (row, freedom): of all contact points, scaled so that the sum of squares is the objective "all points"
    round_pairs      how many pairs of round faces have no rows here
    """

    measures: np.ndarray
    by_deviations: np.ndarray
    by_motion: np.ndarray
    gaps: np.ndarray
    gaps_by_deviations: np.ndarray
    gaps_by_motion: np.ndarray
    held: np.ndarray
    displacements: np.ndarray
    round_pairs: int


def linear_model(program: Program) -> LinearModel:
    """The model of a program, by central differences of its Functions."""
    count = len(program.nominal.contributors)
    placed = [program.place(deviations=sign * STEP * np.eye(count))["poses"] for sign in (1, -1)]
    own = [_seen(program, poses, sign * STEP * np.eye(count)) for poses, sign in zip(placed, (1, -1), strict=True)]
    moved = [_seen(program, poses, np.zeros((len(poses), count))) for poses in (_motions(program, 1), _motions(program, -1))]
    (measures,), (gaps,) = _seen(program, _at_rest(program, 1), np.zeros((1, count)))
    by_deviations, by_motion = (
        [(ahead - behind).T / (2 * STEP) for ahead, behind in zip(*both, strict=True)] for both in (own, moved)
    )
    return LinearModel(
        measures, by_deviations[0], by_motion[0], gaps, by_deviations[1], by_motion[1], _held(program), _displacements(program),
        sum(each is None for each in program.gaps),
    )  # fmt: skip


def leverages(program: Program) -> np.ndarray:
    """Of each locator (contributor,) the largest displacement of any vertex of its part for 1 mm, nominally; NaN for others.

    It is 1 of three locators on a plane that span all of the part, and more the closer together they stand.
    """
    nominal = program.nominal
    found = np.full(len(nominal.contributors), np.nan)
    for number, part in enumerate(nominal.parts):
        columns = nominal.columns(number)
        if not len(columns):
            continue
        steps = np.zeros((len(columns), len(found)))
        steps[np.arange(len(columns)), columns] = STEP
        ends = [
            program.place(deviations=sign * steps)["poses"].reshape(len(columns), len(nominal.parts), -1)[:, number]
            for sign in (1, -1)
        ]
        apart = pose.apply(ends[0], part.vertices) - pose.apply(ends[1], part.vertices)
        found[columns] = np.linalg.norm(apart, axis=-1).max(axis=-1, initial=0) / (2 * STEP)
    return found


def _seen(program: Program, poses: np.ndarray, deviations: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Measures (n, measure) and gaps (n, row) at poses (n, part * 12)."""
    seen = program.observe(poses=poses, deviations=deviations)
    relative = seen["relative"].reshape(len(poses), len(program.nominal.pairs), pose.ENTRIES)
    rows = []
    for k, each in enumerate(program.gaps):
        if each is not None:
            of_pose, of_deviations = np.split(each.coordinates[:, each.corners], [each.basis.shape[1]])
            entries = np.column_stack([relative[:, k], np.ones(len(poses))])
            rows.append(entries @ each.basis @ of_pose + deviations[:, each.columns] @ of_deviations)
    return seen["measured"], np.column_stack([np.zeros((len(poses), 0)), *rows])


def _at_rest(program: Program, count: int) -> np.ndarray:
    return np.tile(pose.AT_REST, (count, len(program.nominal.parts)))


def _freedoms(program: Program) -> list[tuple[Group, int, int]]:
    """Group, position of the mover among its free parts, and axis (0 to 2 shifts, 3 to 5 turns), of all freedoms."""
    return [(own.group, mover, axis) for own in program.groups for mover in range(len(own.group.free)) for axis in range(6)]


def _moves(group: Group, mover: int, axis: int, points: np.ndarray) -> np.ndarray:
    """Displacements (point, 3) for 1 of a freedom."""
    centre = group.carried[group.position(group.free[mover])].centre
    unit = np.eye(3)[axis % 3]
    return np.broadcast_to(unit, points.shape) if axis < 3 else np.cross(unit / group.length, points - centre)


def _motions(program: Program, sign: int) -> np.ndarray:
    """Poses (freedom, part * 12) with a small step of each freedom."""
    freedoms = _freedoms(program)
    found = _at_rest(program, len(freedoms)).reshape(len(freedoms), len(program.nominal.parts), pose.ENTRIES)
    for row, (group, mover, axis) in enumerate(freedoms):
        origin, *ends = _moves(group, mover, axis, np.vstack([np.zeros(3), np.eye(3)]))
        turn = np.column_stack([end - origin for end in ends])
        for part, carried in zip(group.parts, group.carried, strict=True):
            if mover in carried.movers:
                found[row, part] += sign * STEP * np.concatenate([turn.ravel(), origin])
    return np.asarray(found.reshape(len(freedoms), pose.ENTRIES * len(program.nominal.parts)))


def _held(program: Program) -> np.ndarray:
    if not program.method.minimizes.presses:
        return np.zeros((0, len(_freedoms(program))))
    rows = []
    for own in program.groups:
        for number, part in enumerate(own.group.free):
            nominal = program.nominal.parts[part]
            exact = ~nominal.locators.one_sided
            for p, n in zip(nominal.locators.points[exact], nominal.locators.directions[exact], strict=True):
                rows.append([  # what carries the part carries its locators with it
                    n @ _moves(group, mover, axis, p[None])[0] if group is own.group and mover == number else 0.0
                    for group, mover, axis in _freedoms(program)
                ])  # fmt: skip
    return np.array(rows).reshape(-1, len(_freedoms(program)))


def _displacements(program: Program) -> np.ndarray:
    freedoms, rows = _freedoms(program), []
    for own in program.groups:
        count = sum(len(side.points) for side in own.group.sides)
        for side in own.group.sides:
            movers = own.group.carried[side.part].movers
            columns = [
                _moves(group, mover, axis, side.points).ravel() / np.sqrt(2 * count)
                if group is own.group and mover in movers
                else np.zeros(side.points.size)
                for group, mover, axis in freedoms
            ]
            rows.append(np.column_stack(columns))
    return np.vstack([np.zeros((0, len(freedoms))), *rows])
