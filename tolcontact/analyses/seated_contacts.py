"""Contacts of the assembly where its forces seat it: without deviations, and without friction."""

import numpy as np

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.compilation import Program, compile_program
from tolcontact.discretization import raised_places
from tolcontact.method import Method
from tolcontact.simulation import simulate_blocks
from tolcontact.statics import TOUCH_SHARE, Touching, TouchingPlaces, contacts_at
from tolcontact.variation import GivenDraws

STEP = 1e-6  # mm, of differences of the gaps of round faces


def seated_contacts(program: Program) -> Touching | None:
    """Return the contacts at the pose of exact seating; None if the forces find no such pose."""
    seated = compile_program(program.nominal, program.plugin.name, Method(resolution="exact", objective="seating"))
    deviations = np.zeros((1, len(program.nominal.contributors)))
    (block,) = simulate_blocks(seated, samples=1, seed=0, draws=GivenDraws(deviations), block=1)
    if block.status[0] not in terms.CERTIFIED:
        return None
    poses, pairs = block.poses[:, terms.CORRECTED], program.nominal.pairs
    relative = seated.observe(poses=poses, deviations=deviations)["relative"].reshape(1, len(pairs), pose.ENTRIES)
    places = [
        _in_assembly(_touching(seated, k, relative[:, k], deviations), poses[0, pair.reference or 0])
        for k, pair in enumerate(pairs)
        if not pair.is_supports
    ]
    return contacts_at(program.nominal, poses[0], places)


def _in_assembly(places: TouchingPlaces, X_WR: np.ndarray) -> TouchingPlaces:
    """Return places of the frame of a reference part at X_WR (12,) in that of the assembly."""
    return TouchingPlaces(pose.apply(X_WR, places.points), places.normals @ pose.rotation(X_WR).T)


def _touching(program: Program, k: int, X_RM: np.ndarray, deviations: np.ndarray) -> TouchingPlaces:
    """Return the places at which pair k touches at X_RM (1, 12), in the frame of its reference part."""
    pair = program.nominal.pairs[k]
    assert pair.moving_face is not None and pair.reference_face is not None
    nearness = TOUCH_SHARE * max(pair.moving_face.mesh.scale, pair.reference_face.mesh.scale)
    if pair.round is not None:
        return _touching_round(program, k, X_RM, deviations, nearness)
    if k in program.meetings:
        raised = raised_places(pair, program.meetings[k], X_RM, deviations)
        is_near = raised.gaps[0] < nearness
        return TouchingPlaces(pose.apply(X_RM[0], raised.places.P_m[0, is_near]), raised.places.n_r[0, is_near])
    gaps = ((pose.apply(X_RM, pair.P_m) - pair.P_r) * pair.n_r).sum(axis=2)[0]
    return TouchingPlaces(pose.apply(X_RM[0], pair.P_m[gaps < nearness]), pair.n_r[gaps < nearness])


def _touching_round(program: Program, k: int, X_RM: np.ndarray, deviations: np.ndarray, nearness: float) -> TouchingPlaces:
    """Return the places at which balls and shafts touch walls; normals are the derivatives of the gaps by the translation."""
    pair = program.nominal.pairs[k]
    assert pair.round is not None
    shifts = STEP * np.vstack([np.zeros(3), np.eye(3), -np.eye(3)])
    X = np.repeat(X_RM, len(shifts), axis=0)
    X[:, -3:] += shifts
    distances = program.round_gaps[k](X_RM=X, deviations=np.repeat(deviations, len(shifts), axis=0))["distances"]
    is_near = distances[0] < nearness
    normals = ((distances[1:4] - distances[4:]) / (2 * STEP)).T[is_near]
    normals /= np.linalg.norm(normals, axis=1)[:, None]
    centres, radii, on_moving = (pair.round.points[name][is_near] for name in ("centre", "radius", "on_moving"))
    at_body = np.where(on_moving[:, None], pose.apply(X_RM[0], centres), centres)
    return TouchingPlaces(at_body - np.where(on_moving, radii, -radii)[:, None] * normals, normals)
