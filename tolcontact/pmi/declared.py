"""What became of the PMI of a file when the features of a part were declared from it."""

from dataclasses import dataclass

from tolcontact.declaration import DatumTargets, Feature, Pattern
from tolcontact.pmi.annotations import Datum, Dimension, Tolerance
from tolcontact.readable import Readable

Annotation = Tolerance | Dimension | Datum


@dataclass(frozen=True, repr=False)
class DeclaredAnnotation(Readable):
    """A tolerance, dimension or datum of a file: the names of the `features` that state it, and the `reason` if none does.

    With both, the reason says what of it is not declared.
    """

    annotation: Annotation
    features: tuple[str, ...]
    reason: str = ""

    def __str__(self) -> str:
        names = f"declared as {', '.join(self.features)}" if self.features else "not declared"
        return f"{self.annotation}: {names}{f' ({self.reason})' if self.reason else ''}"


@dataclass(frozen=True, repr=False)
class DeclaredPmi(Readable):
    """The features, patterns and datum targets that the PMI of a file has become, and what became of each annotation."""

    features: tuple[Feature | Pattern | DatumTargets, ...]
    annotations: tuple[DeclaredAnnotation, ...]

    @property
    def undeclared(self) -> tuple[DeclaredAnnotation, ...]:
        """The annotations that are not declared, or only in part, with the reasons."""
        return tuple(annotation for annotation in self.annotations if annotation.reason)

    def __str__(self) -> str:
        counts = [
            f"{sum(not entry.reason for entry in entries)} of {len(entries)} {plural}"
            for kind, plural in ((Tolerance, "tolerances"), (Dimension, "dimensions"), (Datum, "datums"))
            if (entries := [entry for entry in self.annotations if isinstance(entry.annotation, kind)])
        ]
        title = f"{len(self.features)} features, patterns and datum targets, which state {', '.join(counts)}"
        return "\n".join([title, *(f"  {annotation}" for annotation in self.undeclared)])
