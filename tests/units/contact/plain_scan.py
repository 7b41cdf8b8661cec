"""The passes of FixedScan in NumPy, in the same order of summation."""

import itertools

import numpy as np

from tolcontact.contact.scan import Deepest


def gaps(scan, relative, deviations):
    slopes = np.repeat(scan.points.basis[-1:], len(relative), axis=0)
    for entry, row in zip(relative.T, scan.points.basis[:-1], strict=True):
        slopes += entry[:, None] * row
    slopes = np.hstack([slopes, deviations[:, scan.points.columns]])
    result = np.repeat(slopes[:, :1], scan.points.coordinates.shape[1], axis=1)
    for slope, row in zip(slopes.T[1:], scan.points.coordinates[1:], strict=True):
        result += slope[:, None] * row
    return result


def survey(scan, relative, deviations, activity):
    active = gaps(scan, relative, deviations) < activity
    sums = [[np.where(active, row, 0.0).sum(axis=1) for row in table] for table in scan.tables]
    return active.sum(axis=1), np.array(sums).transpose(2, 0, 1)


def deepest(scan, relative, deviations, may_carry=None):
    depths = np.minimum(gaps(scan, relative, deviations), 0)
    if may_carry is not None:
        depths = np.where(may_carry, depths, 0)
    firsts = scan.points.leaves[scan.points.branches[scan.clusters]]
    points = np.stack([depths[:, a:b].argmin(axis=1) + a for a, b in itertools.pairwise(firsts)], axis=1)
    return Deepest(points, -np.take_along_axis(depths, points, axis=1))
