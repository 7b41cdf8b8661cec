"""The named choices of how contact is resolved. They decide the answer, so every archive states them."""

from dataclasses import dataclass, replace
from typing import Any, Literal, get_args

from tolcontact.errors import OptionError, check_choice

# A text from elsewhere has no literal type: it is checked when it is used.
Resolution = Literal["linearized", "exact"]
ObjectiveName = Literal["active points", "all points", "locator stiffness", "seating"]
Regularization = Literal["points", "identity"]
ActiveSet = Literal["closed", "initial"]
Search = Literal["fixed", "bounded"]
Solver = Literal["qpoases", "osqp", "daqp", "graph", "piqp", "highs", "proxqp"] | str  # see `compilation/solvers.py`
RESOLUTIONS, REGULARIZATIONS, ACTIVE_SETS, SEARCHES = map(get_args, (Resolution, Regularization, ActiveSet, Search))
# By resolution. That of one linear step is the paper's.
USUAL_SEARCH = {"linearized": "fixed", "exact": "bounded"}
USUAL_OBJECTIVE = {"linearized": "active points", "exact": "all points"}


@dataclass(frozen=True)
class Objective:
    """What a corrected pose minimizes, with everything that depends on this choice but its energy.

    reaction_units   of the reactions at contact points
    counts_points    it sums up displacements of contact points,
    counts_all       of all of them, not only of those that are active in the raw state
    presses          forces press the parts: every realization moves, two-sided locators hold unless they have a stiffness, and
                     a force has to be declared
    """

    name: ObjectiveName
    reaction_units: str
    counts_points: bool = False
    counts_all: bool = False
    presses: bool = False


OBJECTIVES: dict[str, Objective] = {
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
                        mixes mm and rad and so depends on the origin. For eta see tolcontact.mechanics.objective
        active_set      "initial": only points that are active in the raw state are constrained (the paper's set);
                        "closed": points that the correction itself drives into contact are constrained too
        search          "bounded": faces end where they end, and touch at corners, edges and facets of both bodies, found at
                        every pose; "fixed": contact points are projected once, in the nominal state, on planes without end.
                        If it is not given, "bounded" with "exact", and "fixed" with "linearized", which has no other

    `tc.Assembly("vise", method=tc.Method(objective="seating"))` is an example. Every archive states all of these choices.
    """

    resolution: Resolution | str = "exact"
    objective: ObjectiveName | str = ""
    regularization: Regularization = "points"
    active_set: ActiveSet = "closed"
    search: Search | Literal[""] = ""

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
            check_choice(choice, getattr(self, choice), names)
        if self.search != "fixed" and self.resolution != "exact":
            raise OptionError(f'search is "{self.search}" with a linearized resolution; it needs resolution "exact"')

    @classmethod
    def paper(cls) -> "Method":
        """Return the choices of the paper, one step (12) by the points active in the raw state, regularized by eta I (11).

        `tc.run("ra1.py", method=tc.Method.paper())`
        """
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
    def counts_faces(self) -> bool:
        """Whether the objective counts faces, by the moments of the parts that are opposite to each other, not points."""
        return self.is_exact and self.minimizes.counts_all

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
