"""The named choices of how contact is resolved. They decide the answer, so every archive carries them."""

from dataclasses import dataclass

from tolcontact.errors import OptionError

REGULARIZATIONS = ("points", "identity")
ACTIVE_SETS = ("closed", "initial")


@dataclass(frozen=True, kw_only=True)
class Method:
    """How contact is resolved: paper (9) to (12), with its free choices named.

    regularization  "points": eta times the squared displacements of all candidate points, the same in every frame;
                    "identity": the paper's eta I, which mixes mm and rad and so depends on where the origin is
    eta             weight of the regularization, dimensionless (with "identity": mm^2 per rad^2, 1 per mm^2)
    active_set      "initial": only points below `activity` in the raw state are constrained (the paper's set);
                    "closed": points that the correction itself drives into contact are constrained too
    activity        a contact point counts as active below this gap [mm]
    """

    regularization: str = "points"
    eta: float = 1e-6
    active_set: str = "closed"
    activity: float = 1e-9

    def __post_init__(self) -> None:
        for word, choices in (("regularization", REGULARIZATIONS), ("active_set", ACTIVE_SETS)):
            if getattr(self, word) not in choices:
                raise OptionError(f"{word} is {getattr(self, word)!r}; expected one of: {', '.join(choices)}")
        if not 0 < self.eta < 1:
            raise OptionError(f"eta is {self.eta!r}; expected a small number between 0 and 1")
        if not 0 <= self.activity < float("inf"):
            raise OptionError(f"activity is {self.activity!r}; expected a gap in mm, 0 or above")
