"""How far contact moves parts off their rigid two-sided locators, compared with how far these vary."""

import numpy as np

from tolcontact import poses as pose
from tolcontact.arrays import Array, Float
from tolcontact.compilation import Program
from tolcontact.discretization import Nominal
from tolcontact.vocabulary import CORRECTED, RAW


def locator_variations(program: Program) -> Float[Array, " part"]:
    """Return the largest deviation [mm] of any rigid two-sided locator of each part; NaN for a part without one.

    It is half the range of the locator, together with the ranges of the features that displace it.
    """
    nominal, ranges = program.nominal, np.array([contributor.range for contributor in program.draws.contributors])
    largest = np.full(len(nominal.parts), np.nan)
    for index, part in enumerate(nominal.parts):
        columns = nominal.columns(index)
        for locator in np.flatnonzero(part.locators.exact):
            features, factors = part.locators.pushes(int(locator))
            reach = (ranges[columns[locator]] + np.abs(factors) @ ranges[features]) / 2
            largest[index] = np.fmax(largest[index], reach)
    return largest


def locator_offsets(nominal: Nominal, poses: Float[Array, "n state part 12"]) -> Float[Array, "n part"]:
    """Return the largest distance [mm] by which contact moved each part along a rigid two-sided locator; 0 without one.

    It is measured in the frame of the part that it is located on.
    """
    offsets = np.zeros((len(poses), len(nominal.parts)))
    for index, part in enumerate(nominal.parts):
        exact = np.flatnonzero(part.locators.exact) if part.movers else np.zeros(0, dtype=int)
        owners = np.array(part.owners)[exact] if part.owners else np.full(len(exact), index)
        for owner in np.unique(owners):
            own = exact[owners == owner]
            X = poses[:, :, owner] if part.parent is None else pose.relative(poses[:, :, owner], poses[:, :, part.parent])
            moved = pose.apply(X[:, CORRECTED] - X[:, RAW], part.locators.points[own])  # which is linear in the pose
            along = np.abs(np.einsum("nlx,lx->nl", moved, part.locators.directions[own]))
            np.maximum(offsets[:, index], along.max(axis=1), out=offsets[:, index])
    return offsets
