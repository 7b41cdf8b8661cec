"""The check of certified answers against the surfaces themselves, between contact points."""

from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.compilation import Program
from tolcontact.simulation.block import simulate_block
from tolcontact.vocabulary import CORRECTED

TOUCHING_GAP = 1e-6  # mm: a contact point with a smaller gap stands on its plane


class Surfaces(NamedTuple):
    """Results of the check at some poses, both (row, pair) [mm]; NaN for pairs that are not faces.

    penetration   largest depth of one face in the other's body, seen at many points of both
    overhang      how far contact points that touch stand beside the rim of the reference face, which is not there
    false_contact how deep contact points lay inside in the raw state, where the faces were apart; 0 where they were not. NaN
                  also where places of contact are found at every pose
    """

    penetration: Float[Array, "n pair"]
    overhang: Float[Array, "n pair"]
    false_contact: Float[Array, "n pair"]


def check_surfaces(program: Program, poses: Float[Array, "n part 12"], deviations: Float[Array, "n contributor"]) -> Surfaces:
    """Return the check of every pair's faces at corrected poses (row, part, 12), for deviations (row, contributor)."""
    nominal, fixed = program.nominal, not program.method.is_iterated
    surfaces = Surfaces(*(np.full((len(poses), len(nominal.pairs)), np.nan) for _ in Surfaces._fields))
    relative = program.observe(poses=poses, deviations=deviations)["relative"].reshape(len(poses), len(nominal.pairs), 12)
    raw = program.place(deviations=deviations)["poses"]
    raw_relative = program.observe(poses=raw, deviations=deviations)["relative"].reshape(relative.shape)
    for k, pair in enumerate(nominal.pairs):
        faces = nominal.face_pair(k)
        if faces is None or pair.reference is None:
            continue
        X_RM, heights = relative[:, k], pair.heights(deviations)
        surfaces.penetration[:, k] = faces.depth(X_RM, heights)
        if fixed and not pair.round and k not in program.meetings:  # else contact points are those that stand over the face
            places = pose.apply(X_RM, pair.P_m)
            gaps = ((places - pair.P_r) * pair.n_r).sum(axis=2)
            row, point = np.nonzero(gaps < TOUCHING_GAP + heights[:, None])
            depth = np.maximum(-pair.least_gap(raw_relative[:, k], heights), 0)
            surfaces.false_contact[:, k] = np.where(faces.depth(raw_relative[:, k], heights) > 0, 0.0, depth)
            surfaces.overhang[:, k] = 0
            np.maximum.at(surfaces.overhang[:, k], row, faces.reference.face.overhang(places[row, point]))
    return surfaces


def simulated_poses(program: Program, deviations: Float[Array, "n contributor"]) -> Float[Array, "n part 12"]:
    """Return corrected poses (row, part, 12) of some realizations, simulated once more."""
    return simulate_block(program, deviations).poses[:, CORRECTED]
