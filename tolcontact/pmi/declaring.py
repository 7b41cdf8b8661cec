"""Declaration of a part's features from the PMI of its file, as far as features can state it."""

from collections.abc import Collection, Iterable, Iterator, Sequence

from tolcontact.declaration import DatumTargets, Mesh, Part
from tolcontact.declaration.size import Size
from tolcontact.errors import GeometryFault, OptionError, shown
from tolcontact.features import Features, datum_order
from tolcontact.geometry.faces import Meshes
from tolcontact.geometry.files import Shape
from tolcontact.geometry.shapes import shape
from tolcontact.pmi.annotations import Pmi
from tolcontact.pmi.claims import Claim, claims_of
from tolcontact.pmi.declared import DeclaredPmi
from tolcontact.pmi.drafts import Constituent, Declared, Draft, drafts_of, letters_of
from tolcontact.pmi.reading import read_pmi
from tolcontact.pmi.toleranced_surfaces import TolerancedSurfaces


def features_from_pmi(part: Part) -> DeclaredPmi:
    """Declare the features of a part that the PMI of its STEP file states, and return them with all that is not declared.

    The part has to come from a STEP file of AP242. Faces of one surface are one feature, and so are the two planes of a slot or
    a tab whose size or position is toleranced. A feature is named after the letter of its datum, else after its kind and the
    number of its first face, as in "cylinder 12". Features that the part has already stay as they are.
    Raises OptionError if the file cannot be read, or states no PMI.
    """
    geometry = part.geometry
    name = f'part "{shown(part.name)}"'
    if not (isinstance(geometry, Mesh) and geometry.is_step):
        raise OptionError(f"{name} is a {geometry}; only a STEP file of AP242 states PMI")
    try:
        pmi = read_pmi(geometry.source)
        read = shape(geometry)
    except (OptionError, GeometryFault) as error:
        raise OptionError(f"{name}: {error}") from error
    if pmi.is_empty:
        raise OptionError(f"{name}: its file states no tolerances, dimensions or datums as AP242 does")
    features, claims = declare_features(part, pmi, read)
    return DeclaredPmi(features, tuple(claim.result for claim in claims))


def declare_features(part: Part, pmi: Pmi, read: Shape) -> tuple[tuple[Declared, ...], list[Claim]]:
    """Declare the features that PMI states of a part with a shape; return them, and what became of each annotation."""
    surfaces = TolerancedSurfaces(read)
    claims = claims_of(pmi, surfaces)
    meshes = {part: read.mesh}
    return _declare(part, meshes, drafts_of(part, meshes, claims, surfaces)), claims


def _declare(part: Part, meshes: Meshes, drafts: Sequence[Draft]) -> tuple[Declared, ...]:
    """Declare drafts on a part, as far as their tolerances go together, and write into the claims what became of them."""
    trial = Features(0)
    for earlier in datum_order(part)[0]:
        _add(earlier, trial, meshes)
    for draft in _in_order(drafts, trial.datums(0)):
        draft.declared = _tried(draft, part, trial, meshes)
        if draft.declared is not None:
            part.add(draft.declared)
    return tuple(draft.declared for draft in drafts if draft.declared is not None)


def _in_order(drafts: Iterable[Draft], letters: Collection[str | None]) -> Iterator[Draft]:
    """Yield drafts after those of their datums, unless these have `letters` that are declared already.

    Tolerances to datums that no draft is are taken away, with the reason.
    """
    waiting, made = list(drafts), {None, *letters}
    while waiting:
        ready = [
            draft for draft in waiting if draft.letters <= made and not any(member in waiting for member in draft.borrowed)
        ]
        yield from ready
        waiting = [draft for draft in waiting if draft not in ready]
        made |= {draft.letter for draft in ready}
        if not ready:
            _take_away(waiting, made)


def _take_away(waiting: Sequence[Draft], made: set[str | None]) -> None:
    """Take tolerances from drafts that wait: those to datums that nothing is, else those of the first draft in a circle."""
    possible = made | {draft.letter for draft in waiting}
    is_circle = all(draft.letters <= possible for draft in waiting)
    for draft in [next(draft for draft in waiting if draft.stated)] if is_circle else waiting:
        followable = []
        for claim, tolerance in draft.stated:
            absent = letters_of(tolerance) - (made if is_circle else possible)
            if absent:
                claim.refuse(f"datum {min(absent)} {'refers back to it' if is_circle else 'is not declared'}", draft.name)
            else:
                followable.append((claim, tolerance))
        draft.stated = followable


def _tried(draft: Draft, part: Part, trial: Features, meshes: Meshes) -> Declared | None:
    """Return a feature with all that it can state together, which is part of the trial then; None if that is nothing."""
    tolerances: tuple[Constituent, ...] = ()
    name = draft.letter or draft.name
    absent = [member.letter or member.name for member in draft.borrowed if member.declared is None]
    if absent and draft.datum:
        draft.datum.refuse(f"of its surfaces, {', '.join(dict.fromkeys(absent))} could not be declared")
        return None
    if draft.datum and draft.letter in trial.datums(0):
        fault = _fault(draft.with_tolerances(part, ()), trial, meshes)
        draft.datum.refuse(fault or f"the part has a datum {draft.letter} already")
        if draft.borrowed:
            return None
        draft.datum, name = None, draft.name
    for claim, constituent in sorted(draft.stated, key=lambda stated: not isinstance(stated[1], Size)):
        reason = _fault(draft.with_tolerances(part, (*tolerances, constituent)), trial, meshes)
        if reason:
            claim.refuse(reason, name)
        else:
            claim.features.append(name)
            tolerances = (*tolerances, constituent)
    if not (tolerances or draft.datum or draft.is_needed):
        return None
    declared = draft.with_tolerances(part, tolerances)
    reason = _fault(declared, trial, meshes)
    if reason and draft.datum:
        draft.datum.refuse(reason)
    if reason:
        return None
    if draft.datum:
        draft.datum.features.append(name)
    _add(declared, trial, meshes)
    return declared


def _add(declared: Declared, features: Features, meshes: Meshes) -> None:
    if isinstance(declared, DatumTargets):
        features.add_targets(declared, 0)
    else:
        features.add(declared, 0, meshes)


def _fault(declared: Declared, trial: Features, meshes: Meshes) -> str:
    """Return why something cannot be added to what is declared before it; "" if it can."""
    for fault in declared.faults():
        return fault
    try:
        _add(declared, trial.copy(), meshes)
    except GeometryFault as error:
        return str(error)
    return ""
