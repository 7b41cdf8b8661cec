"""The named choices of how contact is resolved. They decide the answer, so every archive carries them."""

from dataclasses import dataclass, replace
from math import pi
from typing import Any

from tolcontact.errors import OptionError

RESOLUTIONS = ("linearized", "exact")
REGULARIZATIONS = ("points", "identity")
ACTIVE_SETS = ("closed", "initial")
SEARCHES = ("fixed", "bounded")
# By resolution. That of one linear step is the paper's.
USUAL_SEARCH = {"linearized": "fixed", "exact": "bounded"}
USUAL_OBJECTIVE = {"linearized": "active points", "exact": "all points"}


@dataclass(frozen=True)
class Objective:
    """What a corrected pose minimizes, with everything that depends on this choice but its energy.

    reaction_units   of what the rows of contact points carry
    counts_points    it sums up displacements of contact points,
    counts_all       of all of them, not only of those that are active in the raw state
    presses          forces press the parts: every realization moves, two-sided locators hold unless they have a stiffness, and
                     a force has to be declared
    """

    name: str
    reaction_units: str
    counts_points: bool = False
    counts_all: bool = False
    presses: bool = False


OBJECTIVES = {
    objective.name: objective
    for objective in (
        Objective("active points", "mm", counts_points=True),
        Objective("all points", "mm", counts_points=True, counts_all=True),
        Objective("locator stiffness", "N"),
        Objective("seating", "N", presses=True),
    )
}


@dataclass(frozen=True, kw_only=True)
class Method:
    """How contact is resolved: paper (9) to (12), with its free choices named.

        resolution      "exact": steps are repeated, with proper rotations, until the true gaps (5) are open and the
                        objective is least; "linearized": one linear step (12), as in the paper
        objective       what the corrected pose minimizes. "all points": half the sum of squared displacements, from the raw
                        state, of all contact points; "active points": of those that are active in the raw state (the
                        paper's); "locator stiffness": the energy of the two-sided locators as springs; "seating": the
                        potential energy of the declared forces, and of locators and pairs with a stiffness, with other
                        two-sided locators exact. If it is not given, "all points" with "exact", and "active points" with
                        "linearized": a single active point holds hardly any turn of its part
        regularization  what holds the degrees of freedom that the objective leaves open. "points": eta times the squared
                        displacements of all contact points, the same in every frame; "identity": the paper's eta I, which
                        mixes mm and rad and so depends on the origin
        eta             weight of the regularization, dimensionless (with "identity": mm^2 per rad^2, 1 per mm^2)
        active_set      "initial": only points below `activity` in the raw state are constrained (the paper's set);
                        "closed": points that the correction itself drives into contact are constrained too
        activity        a contact point is active below this gap [mm]
        search          "bounded": faces end where they end, and touch at corners, edges and facets of both bodies, found at
                        every pose; "fixed": contact points are projected once, in the nominal state, on planes without end.
                        If it is not given, "bounded" with "exact", and "fixed" with "linearized", which has no other
        near_turn       [rad] an answer that turns a part by more, from its raw pose, is doubted: tried again from other
                        starts, and never certified
        near_travel     in sizes of the largest part that contact couples: an answer that moves contact points farther, from
                        their raw places, is doubted, too, and certified only if the faces are free of penetration

    Every archive states all of these choices.
    """

    resolution: str = "exact"
    objective: str = ""
    regularization: str = "points"
    eta: float = 1e-6
    active_set: str = "closed"
    activity: float = 1e-9
    search: str = ""
    near_turn: float = 1.0
    near_travel: float = 0.5

    def __post_init__(self) -> None:
        for choice, usual in (("search", USUAL_SEARCH), ("objective", USUAL_OBJECTIVE)):
            if not getattr(self, choice):
                object.__setattr__(self, choice, usual.get(self.resolution, usual["linearized"]))
        choices = {
            "resolution": RESOLUTIONS,
            "objective": tuple(OBJECTIVES),
            "regularization": REGULARIZATIONS,
            "active_set": ACTIVE_SETS,
            "search": SEARCHES,
        }
        for choice, names in choices.items():
            if getattr(self, choice) not in names:
                raise OptionError(f"{choice} is {getattr(self, choice)!r}; expected one of: {', '.join(names)}")
        if not 0 < self.eta < 1:
            raise OptionError(f"eta is {self.eta!r}; expected a small number between 0 and 1")
        if not 0 <= self.activity < float("inf"):
            raise OptionError(f"activity is {self.activity!r}; expected a gap in mm, 0 or above")
        if not 0 < self.near_turn <= pi:
            raise OptionError(f"near_turn is {self.near_turn!r}; expected an angle in rad, above 0 and at most pi")
        if not 0 < self.near_travel < float("inf"):
            raise OptionError(f"near_travel is {self.near_travel!r}; expected a number of part sizes above 0")
        if self.search != "fixed" and self.resolution != "exact":
            raise OptionError(f'search is "{self.search}" with a linearized resolution; it needs resolution "exact"')

    @classmethod
    def paper(cls) -> "Method":
        """Return the choices of the paper: one step (12) by the points active in the raw state, regularized by eta I (11)."""
        return cls(resolution="linearized", objective="active points", regularization="identity", active_set="initial")

    def with_choices(self, **choices: Any) -> "Method":
        """Return this method with other choices; another resolution comes with its usual search, unless one is given.

        The objective stays, so that resolutions are compared by what they do to one problem.
        """
        other = choices.get("resolution", self.resolution) != self.resolution
        return replace(self, **({"search": ""} if other else {}) | choices)

    @property
    def minimizes(self) -> Objective:
        """The objective, with what depends on it."""
        return OBJECTIVES[self.objective]

    @property
    def is_exact(self) -> bool:
        """Whether steps are repeated until the true gaps are open."""
        return self.resolution == "exact"

    @property
    def is_bounded(self) -> bool:
        """Whether faces end, and touch at corners, edges and facets of both bodies."""
        return self.search == "bounded"

    @property
    def is_closed(self) -> bool:
        """Whether all points may be active, also points that are not active in the raw state.

        Of points in one plane, the corners of their convex hull then suffice.
        """
        return self.active_set == "closed"
