"""The check of certified answers against the surfaces, between contact points."""

import warnings
from typing import NamedTuple

import numpy as np

from tolcontact import poses as pose, vocabulary as terms
from tolcontact.arrays import Array, Float
from tolcontact.compilation import Program
from tolcontact.errors import ContactWarning
from tolcontact.simulation.block import simulate_block
from tolcontact.texts import shown
from tolcontact.vocabulary import CORRECTED

ON_PLANE_GAP = 1e-6  # mm: a contact point with a smaller gap touches its plane
ENDED_SHARE = 1 / 2000  # of the smallest tolerance range: at a larger distance from a touching point, its face has ended
DEFAULT_RANGE = 1.0  # mm: smallest tolerance range if nothing is toleranced


class Surfaces(NamedTuple):
    """Results of the check at some poses, each (row, pair); NaN for pairs that are not faces, or are compliant.

    penetration     largest depth of one face in the body of the other, sampled at many points of both [mm]
    overhang        largest distance of touching contact points from the reference face, outside its boundary [mm]
    false_contact   depth of contact points in the raw state although the faces did not touch [mm]; 0 if the faces did
    contacts        number of touching contact points
    contacts_ended  number of these that touch a plane outside the boundary of its face; NaN if the reference face is curved

    All but the first are also NaN if the contact points are found at every pose.
    """

    penetration: Float[Array, "n pair"]
    overhang: Float[Array, "n pair"]
    false_contact: Float[Array, "n pair"]
    contacts: Float[Array, "n pair"]
    contacts_ended: Float[Array, "n pair"]


def check_surfaces(program: Program, poses: Float[Array, "n part 12"], deviations: Float[Array, "n contributor"]) -> Surfaces:
    """Return the check of every pair's faces at corrected poses (row, part, 12), for deviations (row, contributor)."""
    nominal = program.nominal
    ended = max(ENDED_SHARE * min(nominal.assembly.smallest_zone(), DEFAULT_RANGE), ON_PLANE_GAP)
    surfaces = Surfaces(*(np.full((len(poses), len(nominal.pairs)), np.nan) for _ in Surfaces._fields))
    _, relative = program.observed(poses, deviations)
    _, raw_relative = program.observed(program.place(deviations=deviations)["poses"], deviations)
    for k, pair in enumerate(nominal.pairs):
        faces = nominal.face_pair(k)
        if faces is None or pair.reference is None or pair.is_springy:  # compliant faces may penetrate
            continue
        X_RM, heights = relative[:, k], pair.heights(deviations)
        form = pair.form(deviations)
        surfaces.penetration[:, k] = faces.depth(X_RM, heights, form)
        if pair.samples_faces and k not in program.meetings:  # otherwise contact points project onto the face
            points = pose.apply(X_RM, pair.P_m)
            gaps = pair.nominal_gaps(X_RM)
            raised = heights[:, None] if form is None else heights[:, None] + pair.form_heights(deviations)
            row, point = np.nonzero(gaps < ON_PLANE_GAP + raised)
            depth = np.maximum(-pair.least_gap(raw_relative[:, k], deviations), 0)
            inside = np.flatnonzero(depth)
            form_inside = None if form is None else form.take(inside)
            is_disjoint = ~faces.penetrate(raw_relative[inside, k], heights[inside], form_inside)
            surfaces.false_contact[:, k] = 0
            surfaces.false_contact[inside[is_disjoint], k] = depth[inside[is_disjoint]]
            touching, face = points[row, point], faces.reference.face
            surfaces.overhang[:, k] = 0
            np.maximum.at(surfaces.overhang[:, k], row, face.overhang(touching))
            surfaces.contacts[:, k] = np.bincount(row, minlength=len(poses))
            if face.curvature == 0:
                on_plane = touching - np.broadcast_to(raised, gaps.shape)[row, point, None] * pair.n_r[point]
                is_outside = np.linalg.norm(face.nearest(on_plane)[1] - on_plane, axis=1) > ended
                surfaces.contacts_ended[:, k] = np.bincount(row[is_outside], minlength=len(poses))
    return surfaces


def warn_of(program: Program, surfaces: Surfaces) -> None:
    """Warn of pairs with penetrating surfaces, or with false contact, by more than a share of the smallest tolerance range."""
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
    """Return advice for pair k."""
    if not program.method.is_exact:
        return 'use --resolution exact, or tc.Method(resolution="exact")'
    if not program.method.is_bounded:
        return f'faces may end within reach of contact: leave out search="{program.method.search}"'
    pair = program.nominal.pairs[k]
    if pair.has_form:
        return f"place contact points closer together, such as spacing={pair.form_spacing / 2:.2g}"
    return "use a finer mesh" if k in program.meetings else "use more contact points"


def simulated_poses(program: Program, deviations: Float[Array, "n contributor"]) -> Float[Array, "n part 12"]:
    """Return corrected poses (row, part, 12) of realizations, which are simulated again."""
    return simulate_block(program, deviations).poses[:, CORRECTED]
