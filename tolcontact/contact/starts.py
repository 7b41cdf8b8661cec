"""Where steps start, and how they keep bodies apart."""

from typing import NamedTuple

STRIDE, SMALL_STRIDE = 0.5, 0.05  # rad: the largest rotation of a part in one step; linear rows lose accuracy long before


class Start(NamedTuple):
    """Where steps start, and how large they may be.

    at_nominal   whether they start from the nominal instead of the raw poses
    at_answer    whether they start from the best answer so far
    projected    whether contact points are projected again, before every step, onto curved faces
    stride       the largest rotation of a part in one step [rad]
    balances     whether steps end where they are rounding, though they may grow from there
    guarded      whether bodies that interfere where no place of contact shows it get such a place (see Guard)
    parted       whether convex bodies are separated only in the best direction (see Parting)
    free         whether bodies are moved apart first, and steps end before they enter each other (see FreeSteps)
    """

    at_nominal: bool = False
    at_answer: bool = False
    projected: bool = False
    stride: float = STRIDE
    balances: bool = False
    guarded: bool = False
    parted: bool = False
    free: bool = False


FIRST = Start()
OTHER_STARTS = (Start(at_nominal=True), Start(stride=SMALL_STRIDE))  # if no face is curved
OTHER_STARTS_CURVED = (Start(projected=True), Start(projected=True, at_nominal=True))
# Planes at fixed points of a shaft leave it as it spins. If its spin is free, rounding grows until it slips through them.
BALANCE = Start(balances=True)
GUARDED = (Start(guarded=True, at_answer=True), Start(guarded=True), Start(guarded=True, stride=SMALL_STRIDE))
PARTED = (Start(parted=True), Start(parted=True, stride=SMALL_STRIDE))
# Where bodies can separate in several directions, full steps alternate between these, or their rows contradict each other.
FREE_WHERE_RAW = Start(free=True)
FREE = (Start(free=True, at_nominal=True), FREE_WHERE_RAW)
