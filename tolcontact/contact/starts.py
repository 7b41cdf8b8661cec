"""Where steps start, how they keep bodies apart, and which realizations get other starts.

    raw pose, FIRST --> certified and near its raw pose -------------------> answer
         |                                                                     ^
         +--> the rescues, in their order: each takes the realizations         |
              that it names, and the better answer stays ----------------------+

The status follows from the answer that is left: certified, a conflict (not assemblable), doubtful, or not converged.
"""

from typing import NamedTuple

STRIDE, SMALL_STRIDE = 0.5, 0.05  # rad: the largest rotation of a part in one step; linear rows lose accuracy long before
SHORT_STRIDES = 0.01, 0.002  # rad: steps that follow a path


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
    sloped       whether rows of rims that cross have the slope of their gap (see Meeting.sloped)
    gain         share of the objective by which a certified answer must be better than another one
    """

    at_nominal: bool = False
    at_answer: bool = False
    projected: bool = False
    stride: float = STRIDE
    balances: bool = False
    guarded: bool = False
    parted: bool = False
    free: bool = False
    sloped: bool = False
    gain: float = 1e-6


class Rescue(NamedTuple):
    """Other starts for realizations whose best answer so far is not certain, or no optimum. A better answer replaces it.

    rows      the realizations: "apart", whose raw bodies are apart although gaps deny it; "no answer"; "interfere", with bodies
              that interfere in their answer; "uncertain", not certified; "uncertain or far", these and certified ones far from
              their raw pose; "not separated", without an answer, or with bodies that interfere in it; "slanted", certified ones
              with rims under load where the slope of their gap differs from the normal of the plane
    surfaces  which pairs the group must have: "any", "curved" faces or only "flat" ones, no pair of bounded faces whose bodies
              are not tested for interference ("guarded"), or convex bodies that are parted in one direction ("convex")
    starts    one after the other, until the answer is certified, or two of them end in the same conflict
    """

    rows: str
    surfaces: str
    starts: tuple[Start, ...]


FIRST = Start()
# Where bodies can separate in several directions, full steps alternate between these, or their rows contradict each other.
FREE_WHERE_RAW = Start(free=True)
RESCUES = (
    Rescue("apart", "guarded", (FREE_WHERE_RAW,)),
    # Planes at fixed points of a shaft leave it as it spins. If its spin is free, rounding grows until it slips through them.
    Rescue("no answer", "curved", (Start(balances=True),)),
    Rescue(
        "interfere",
        "any",
        (Start(guarded=True, at_answer=True), Start(guarded=True), Start(guarded=True, stride=SMALL_STRIDE)),
    ),
    Rescue("uncertain or far", "curved", (Start(projected=True), Start(projected=True, at_nominal=True))),
    Rescue("uncertain or far", "flat", (Start(at_nominal=True), Start(stride=SMALL_STRIDE))),
    Rescue("not separated", "convex", (Start(parted=True), Start(parted=True, stride=SMALL_STRIDE))),
    Rescue("uncertain", "guarded", (Start(free=True, at_nominal=True),)),
    # Steps of free bodies may end between two sets of places. The path of short steps from the first answer often avoids this.
    Rescue(
        "uncertain",
        "guarded",
        (
            FREE_WHERE_RAW,
            Start(free=True, at_answer=True),
            *(Start(guarded=True, at_answer=True, stride=stride) for stride in SHORT_STRIDES),
            Start(guarded=True, stride=SHORT_STRIDES[0]),
        ),
    ),
    # Rows with the normal of the plane end at the same answer from everywhere, which may be beside the optimum. Rows with the
    # slope end at one of several optima. It must be clearly better: else answers would depend on the rounding of solvers.
    Rescue("slanted", "any", (Start(sloped=True, at_answer=True, gain=1e-4),)),
)
