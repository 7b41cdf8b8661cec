"""Contact pairs: gaps and overlaps that do not vary enough, coarse contact points, seats that friction may keep parts off."""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np
from scipy.spatial.transform import Rotation

from tolcontact import poses as pose
from tolcontact.declaration import ContactPair, Face, Inside, Part
from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.geometry.curvature import CHORD_SHARE
from tolcontact.mechanics.displacement import central_moments, moments_about
from tolcontact.plausibility.trial_draws import SIGMAS, TrialDraws, spread
from tolcontact.statics import TouchingPoints, balances, contacts_at, drawn_contacts

FAR_SIGMAS = 30.0  # of a gap: contact beyond does not act
MIN_SHARE = 1e-5  # of a face's size: overlaps and gaps below are rounding of coordinates
MIN_RANGE_SHARE = 0.05  # of the smallest tolerance range
SMALL_TURN = 1e-3  # rad
MIN_ARM = 0.03  # sizes of a part: root mean square distance of its contact points from the line closest to them


def pair_overlaps(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each contact pair whose faces penetrate each other in nearly every realization."""
    for k, pair, noise in _face_pairs(draws):
        gaps = draws.nominal_gaps(k)
        if gaps.min() < -noise:
            varying = draws.gaps(k, np.array([gaps.argmin()]))[:, 0]
            sigma = float(spread(varying))
            if float(np.median(varying)) + SIGMAS * sigma < 0:
                yield (
                    f"{_place(draws, k)}: its faces overlap by {-gaps.min():.3g} mm in the nominal assembly, far beyond "
                    f"what varies there (3 sigma {SIGMAS * sigma:.2g} mm); check the places and sizes of {_sides(draws, pair)}"
                )


def repeated_pairs(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each contact pair with the faces of an earlier one, in the same order or in the other."""
    nominal, by_parts = draws.program.nominal, defaultdict[tuple[str, frozenset[Part]], list[ContactPair]](list)
    for pair in nominal.assembly.pairs:
        by_parts[pair.station, frozenset((pair.moving.part, pair.reference.part))].append(pair)
    for pairs in by_parts.values():
        earlier = dict[frozenset[tuple[Part, tuple[int, ...], str]], ContactPair]()
        for pair in pairs if len(pairs) > 1 else ():
            first = earlier.setdefault(frozenset(_extent(nominal, face) for face in (pair.moving, pair.reference)), pair)
            if first is not pair:
                order = "" if first.moving.part is pair.moving.part else ", with the sides exchanged"
                yield f'{pair.designation}: it is declared twice: "{first.name}" has its faces{order}; leave one of them out'


def _extent(nominal: Nominal, face: Face) -> tuple[Part, tuple[int, ...], str]:
    """Return what two equal faces have in common: the part, its triangles, and the boxes that cut these."""
    boxes = " ".join(str(selection) for selection in face.selections if isinstance(selection, Inside))
    return face.part, tuple(nominal.triangles(face)), boxes


def pair_clearances(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each contact pair whose faces are too far apart to touch in any realization."""
    if draws.program.method.minimizes.presses:  # forces close gaps
        return
    for k, pair, noise in _face_pairs(draws):
        nominal = float(draws.nominal_gaps(k).min())
        if nominal <= noise:
            continue
        least = draws.gaps(k, np.arange(len(pair.P_m))).min(axis=1)
        sigma = float(spread(least))
        if float(least.min()) > draws.pushed_by_others(k) + FAR_SIGMAS * sigma:
            yield (
                f"{_place(draws, k)}: its faces are {nominal:.3g} mm apart in the nominal assembly, and vary by "
                f"{SIGMAS * sigma:.2g} mm (3 sigma), so they never touch; check the places of "
                f"{_sides(draws, pair)}, or leave the pair out"
            )


def coarse_pairs(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence if contact points or triangles of a pair of curved faces are coarse compared with the tolerances.

    Errors below the rounding of coordinates in files, which bends flat faces, do not count.
    """
    nominal = draws.program.nominal
    for k, pair in enumerate(nominal.pairs):
        if pair.sampling_error is None:
            continue
        scenes = nominal.scenes or (nominal,)
        finest = next(s.assembly for s in scenes if pair.name in [other.name for other in s.assembly.pairs]).smallest_zone()
        for error, place, advice in (
            (pair.sampling_error, "between its contact points", "give it more points, or leave points and spacing out"),
            (pair.facets, "between flat triangles and the round faces that they approximate", "use a finer mesh"),
        ):
            if error > max(CHORD_SHARE * finest, pair.coordinate_error):
                yield (
                    f"{_place(draws, k)}: parts may be off by up to {error:.2g} mm {place}, "
                    f"{error / finest:.2g} of the smallest tolerance ({finest:.4g} mm); {advice}"
                )


def unconstrained_rotations(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each free part whose contact points lie close to a line, so that they hardly hold its rotation.

    A rotation about that line hardly displaces them: contact may rotate the part far to save a small displacement of points.
    The points of parts located on it count as its own, and a contact point of a ball counts as the ball. Round faces alone
    do not rotate a part about their axis, since their normals pass through it.
    """
    method, parts, pairs = draws.program.method, draws.program.nominal.parts, draws.program.nominal.pairs
    for group in (compiled.group for compiled in draws.program.groups) if method.minimizes.counts_points else ():
        for mover, index in enumerate(group.free):
            moved = [side for side in group.sides if mover in group.mobilities[side.part].movers[-1:]]
            if not any(pairs[group.pairs[side.pair]].samples_faces for side in moved):
                continue
            origin = np.asarray(moved[0].centre)
            moments = np.sum([moments_about(origin, side.moments, np.asarray(side.centre)) for side in moved], axis=0)
            size = max(parts[number].mesh.scale for number in {index, *(group.parts[side.part] for side in moved)})
            squares = np.linalg.eigvalsh(central_moments(origin, moments)[1])
            arm = float(np.sqrt(max(squares[:-1].sum(), 0.0)))
            if arm < MIN_ARM * size:
                yield (
                    f"{parts[index].part.designation}: its contact points lie close to a line ({arm:.2g} mm away, root mean "
                    f'square; it is {size:.3g} mm large), so that objective "{method.objective}" hardly holds its rotation '
                    'about the line; choose objective "locator stiffness", or spread its contact points'
                )


def free_turns(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each part with a rotation that nothing holds against forces, and that a measurement depends on.

    All contact points count, whether they touch nominally or not, since forces close gaps.
    """
    nominal = draws.program.nominal
    if not draws.program.method.minimizes.presses or draws.program.bending is not None:
        return
    pairs = [pair for pair in nominal.pairs if not pair.is_supports]
    at_rest = np.tile(pose.AT_REST, (len(nominal.parts), 1))
    for balance in balances(contacts_at(nominal, at_rest, [TouchingPoints(pair.P_r, pair.n_r) for pair in pairs])):
        for part, point, axis in balance.free_turns():
            poses = np.tile(at_rest, (2, 1, 1))
            R = Rotation.from_rotvec(np.outer((-SMALL_TURN, SMALL_TURN), axis)).as_matrix()
            poses[:, part] = np.concatenate([R.reshape(2, 9), point - R @ point], axis=1)
            at = draws.program.observe(poses=poses, deviations=np.zeros((2, draws.deviations.shape[1])))["measured"]
            moved = np.abs(at[1] - at[0]) > MIN_SHARE * SMALL_TURN * nominal.parts[part].mesh.scale
            names = [f'"{measure.name}"' for measure, moves in zip(nominal.measures, moved, strict=True) if moves]
            if names:
                yield (
                    f"{nominal.parts[part].part.designation}: nothing holds its rotation about the line through "
                    f"{_vector(point)} along {_vector(axis)}, and no force causes it, but {', '.join(names)} "
                    f"{'depends' if len(names) == 1 else 'depend'} on it; give the part a two-sided locator across this line"
                )


def _vector(values: np.ndarray) -> str:
    return f"({', '.join(f'{value + 0.0:.4g}' for value in np.round(values, 6))})"


def unused_forces(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence if the model declares forces, and its objective uses none."""
    method, forces = draws.program.method, draws.program.nominal.assembly.forces
    if forces and not method.minimizes.presses:
        names = ", ".join(f'"{force.name}"' for force in forces)
        yield (
            f'{"forces" if len(forces) > 1 else "force"} {names}: without effect, since objective "{method.objective}" uses no '
            'forces; choose objective "seating", or leave them out'
        )


def _face_pairs(draws: TrialDraws) -> Iterator[tuple[int, ContactPoints, float]]:
    """Yield the pairs of faces with their numbers, and the gaps [mm] that are rounding or error of triangles."""
    smallest = draws.program.nominal.assembly.smallest_zone()
    for k, pair in enumerate(draws.program.nominal.pairs):
        if pair.moving_face is not None and pair.reference_face is not None and len(draws.deviations):
            size = max(pair.moving_face.mesh.scale, pair.reference_face.mesh.scale)
            share = MIN_RANGE_SHARE * smallest if np.isfinite(smallest) else 0.0
            yield k, pair, max(2 * pair.facets, pair.bulge, MIN_SHARE * size, share)


def _place(draws: TrialDraws, k: int) -> str:
    name = draws.program.nominal.pairs[k].name
    return next(pair for pair in draws.program.nominal.assembly.pairs if pair.name == name).designation


def _sides(draws: TrialDraws, pair: ContactPoints) -> str:
    return " and ".join(f'"{draws.program.nominal.parts[part or 0].name}"' for part in (pair.moving, pair.reference))


def unsure_seats(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each seat if the stated friction can keep its part off it."""
    assembly = draws.program.nominal.assembly
    if not assembly.forces or all(mu is None for mu in (assembly.mu, *(pair.mu for pair in assembly.pairs))):
        return
    touching = drawn_contacts(draws.program.nominal)
    for balance in balances(touching):
        for seat in balance.seats() if balance.is_pressed and balance.is_held else ():
            if seat.critical > 0 and seat.reserve <= 1:
                holders = ", ".join(f'"{touching.contacts[k].label}"' for k in (-seat.shares).argsort() if seat.shares[k] > 0)
                yield (
                    f'seat "{seat.contact.label}": the forces may not push the part onto it, since friction can hold it short '
                    f"of it: {seat.reserve:.3g} of the stated coefficients suffice, at {holders}; push harder along the seat, "
                    "reduce friction there, or state its actual coefficients"
                )
