"""The order in which features, patterns and datum targets of a part become numbers: each after what it refers to."""

from tolcontact.declaration import DatumTargets, Feature, Part, Pattern

Declared = Feature | Pattern | DatumTargets


def datum_order(part: Part) -> tuple[list[Declared], list[Declared]]:
    """Return what is declared of a part, each after its datums, and those whose datums refer to each other in a circle."""
    remaining: list[Declared] = [*part.toleranced, *part.targets]
    letters, present, ordered = set[str](), set[Feature](), list[Declared]()
    while remaining:
        ready = [declared for declared in remaining if _letters(declared) <= letters and _features(declared) <= present]
        if not ready:
            return ordered, remaining
        for declared in ready:
            ordered.append(declared)
            present |= set() if isinstance(declared, DatumTargets) else set(declared.members)
            letters |= {letter for letter in [_letter(declared)] if letter}
        remaining = [declared for declared in remaining if declared not in ready]
    return ordered, []


def _letter(declared: Declared) -> str | None:
    return declared.letter if isinstance(declared, DatumTargets) else declared.datum


def _letters(declared: Declared) -> set[str]:
    """Return the datums that tolerances refer to."""
    tolerances = () if isinstance(declared, DatumTargets) else declared.geometric
    return {letter for tolerance in tolerances for compartment in tolerance.system for letter in compartment}


def _features(declared: Declared) -> set[Feature]:
    """Return the features that members or targets are."""
    if isinstance(declared, DatumTargets):
        return set(declared.features)
    return set(declared.borrowed) if isinstance(declared, Pattern) else set()
