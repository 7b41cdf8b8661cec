"""The check of certified answers against the surfaces themselves, between contact points."""

import warnings
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.arrays import Array, Float
from tolcontact.compilation import Program
from tolcontact.errors import ContactWarning, shown
from tolcontact.simulation.block import simulate_block
from tolcontact.vocabulary import CORRECTED

ON_PLANE_GAP = 1e-6  # mm: a contact point with a smaller gap stands on its plane
ENDED_SHARE = 1 / 2000  # of the smallest tolerance range: a face that is farther from a point on its plane has ended there
FAR = 1.0  # mm: range in its place if nothing is toleranced


class Surfaces(NamedTuple):
    """Results of the check at some poses, each (row, pair); NaN for pairs that are not faces, or give way.

    penetration     largest depth of one face in the other's body, seen at many points of both [mm]
    overhang        how far contact points that touch stand beside the rim of the reference face, which is not there [mm]
    false_contact   how deep contact points lay inside in the raw state, where the faces were apart [mm]; 0 where they were not
    contacts        number of contact points that touch
    contacts_ended  number of these that touch a plane where its face has ended; NaN if the reference face is curved

    All but the first are NaN also where places of contact follow from every pose.
    """

    penetration: Float[Array, "n pair"]
    overhang: Float[Array, "n pair"]
    false_contact: Float[Array, "n pair"]
    contacts: Float[Array, "n pair"]
    contacts_ended: Float[Array, "n pair"]


def check_surfaces(program: Program, poses: Float[Array, "n part 12"], deviations: Float[Array, "n contributor"]) -> Surfaces:
    """Return the check of every pair's faces at corrected poses (row, part, 12), for deviations (row, contributor)."""
    nominal, fixed = program.nominal, not program.method.is_iterated
    ended = max(ENDED_SHARE * min(nominal.assembly.smallest_zone(), FAR), ON_PLANE_GAP)
    surfaces = Surfaces(*(np.full((len(poses), len(nominal.pairs)), np.nan) for _ in Surfaces._fields))
    relative = program.observe(poses=poses, deviations=deviations)["relative"].reshape(len(poses), len(nominal.pairs), 12)
    raw = program.place(deviations=deviations)["poses"]
    raw_relative = program.observe(poses=raw, deviations=deviations)["relative"].reshape(relative.shape)
    for k, pair in enumerate(nominal.pairs):
        faces = nominal.face_pair(k)
        if faces is None or pair.reference is None or pair.is_springy:  # what gives way may be inside
            continue
        X_RM, heights = relative[:, k], pair.heights(deviations)
        form = pair.form(deviations) if pair.has_form else None
        surfaces.penetration[:, k] = faces.depth(X_RM, heights, form)
        if fixed and not pair.round and k not in program.meetings:  # else contact points are those that stand over the face
            places = pose.apply(X_RM, pair.P_m)
            gaps = ((places - pair.P_r) * pair.n_r).sum(axis=2)
            raised = heights[:, None] if form is None else heights[:, None] + pair.form_heights(deviations)
            row, point = np.nonzero(gaps < ON_PLANE_GAP + raised)
            depth = np.maximum(-pair.least_gap(raw_relative[:, k], deviations), 0)
            inside = np.flatnonzero(depth)
            of_inside = None if form is None else form.take(inside)
            are_apart = ~faces.penetrate(raw_relative[inside, k], heights[inside], of_inside)
            surfaces.false_contact[:, k] = 0
            surfaces.false_contact[inside[are_apart], k] = depth[inside[are_apart]]
            touching, face = places[row, point], faces.reference.face
            surfaces.overhang[:, k] = 0
            np.maximum.at(surfaces.overhang[:, k], row, face.overhang(touching))
            surfaces.contacts[:, k] = np.bincount(row, minlength=len(poses))
            if face.curvature == 0:
                feet = touching - np.broadcast_to(raised, gaps.shape)[row, point, None] * pair.n_r[point]
                away = np.linalg.norm(face.nearest(feet)[1] - feet, axis=1) > ended
                surfaces.contacts_ended[:, k] = np.bincount(row[away], minlength=len(poses))
    return surfaces


def warn_of(program: Program, surfaces: Surfaces) -> None:
    """Warn of pairs whose surfaces penetrate each other, or were resolved though apart, by more than a share of the range."""
    limit = terms.NOTICED_SHARE * program.nominal.assembly.smallest_zone()
    for k, pair in enumerate(program.nominal.pairs):
        findings = (
            (surfaces.penetration, "its surfaces penetrate each other by up to {:.3g} mm in certified realizations"),
            (surfaces.false_contact, "contact was resolved where its surfaces are apart: points lay up to {:.3g} mm inside"),
        )
        for depths, text in findings:
            deepest = float(np.nan_to_num(depths[:, k]).max(initial=0))
            if deepest > limit:
                warnings.warn(
                    f'contact pair "{shown(pair.name)}": {text.format(deepest)}; {_advice(program, k)}',
                    ContactWarning,
                    stacklevel=2,
                )


def _advice(program: Program, k: int) -> str:
    """Return what to do about pair k."""
    if not program.method.is_exact:
        return 'use --resolution exact, or tc.Method(resolution="exact")'
    if not program.method.is_bounded:
        return f'faces may end within reach of contact: leave out search="{program.method.search}"'
    pair = program.nominal.pairs[k]
    if pair.has_form:
        return f"place contact points closer together, such as spacing={pair.form_spacing / 2:.2g}"
    return "use a finer mesh" if k in program.meetings else "use more contact points"


def simulated_poses(program: Program, deviations: Float[Array, "n contributor"]) -> Float[Array, "n part 12"]:
    """Return corrected poses (row, part, 12) of some realizations, simulated once more."""
    return simulate_block(program, deviations).poses[:, CORRECTED]
