"""Distances of segments, and the least of several expressions."""

from collections.abc import Sequence
from typing import Any

import casadi as ca

MIN_SQUARE = 1e-300  # of a length: keeps quotients finite where a segment has no length


def least(values: Any) -> ca.SX:
    """Return the least of several expressions."""
    return ca.mmin(ca.vertcat(*values))


def segment_distance(moving: Sequence[ca.SX], reference: Sequence[ca.SX]) -> ca.SX:
    """Return the shortest distance [mm] of two segments between ends (3, 1); parallel ones are no exception.

    It is the least of five: from each end to the other segment, and between the places where the two lines are nearest if
    both lie between the ends (Ericson, Real-Time Collision Detection, 5.1.9). All are distances of places of both segments, so
    where lines are almost parallel, and these places uncertain, none is too short.
    """
    p, q, r = moving[1] - moving[0], reference[1] - reference[0], reference[0] - moving[0]
    pp, qq, pq = ca.dot(p, p), ca.dot(q, q), ca.dot(p, q)

    def squared(s: ca.SX | float, t: ca.SX | float) -> ca.SX:
        return ca.sumsqr(r + t * q - s * p)

    def on_moving(t: ca.SX | float) -> ca.SX:
        return clipped(ca.dot(p, r + t * q) / ca.fmax(pp, MIN_SQUARE))

    def on_reference(s: ca.SX | float) -> ca.SX:
        return clipped(ca.dot(q, s * p - r) / ca.fmax(qq, MIN_SQUARE))

    inner = clipped((ca.dot(p, r) * qq - ca.dot(q, r) * pq) / ca.fmax(pp * qq - pq**2, MIN_SQUARE))
    squares = [squared(s, on_reference(s)) for s in (0.0, 1.0, inner)] + [squared(on_moving(t), t) for t in (0.0, 1.0)]
    return ca.sqrt(least(squares))


def clipped(share: ca.SX) -> ca.SX:
    """Return a share of a segment, at its ends if it lies beyond them."""
    return ca.fmin(ca.fmax(share, 0), 1)
