"""Declaration of a part's features from the PMI of its file, as far as features can state it."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from tolcontact.declaration import Brep, Face, Feature, Mesh, Part
from tolcontact.declaration.feature_tolerance import GeometricTolerance, Size
from tolcontact.declaration.geometry import STEP
from tolcontact.declaration.values import script_line
from tolcontact.errors import GeometryFault, ModelError, OptionError
from tolcontact.features import Features, datum_order
from tolcontact.features.feature_geometry import AxisFeature, FeatureGeometry, FeatureOfSize, GeneralFeature, SlabFeature
from tolcontact.features.feature_recognition import feature_geometry
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.geometry.files import Shape
from tolcontact.geometry.shapes import shape
from tolcontact.pmi import declarable
from tolcontact.pmi.annotations import Datum, Dimension, Pmi
from tolcontact.pmi.claims import Claim, Place, claims_of
from tolcontact.pmi.declarable import Undeclared
from tolcontact.pmi.declared import DeclaredPmi
from tolcontact.pmi.reading import read_pmi
from tolcontact.pmi.toleranced_surfaces import TolerancedSurfaces

Constituent = Size | GeometricTolerance


def features_from_pmi(part: Part) -> DeclaredPmi:
    """Declare the features of a part that the PMI of its STEP file states, and return them with all that is not declared.

    The part has to come from a STEP file of AP242. Faces of one surface are one feature, and so are the two planes of a slot or
    a tab whose size or position is toleranced. A feature is named after the letter of its datum, else after its kind and the
    number of its first face, as in "cylinder 12". Features that the part has already stay as they are.
    Raises ModelError if the file cannot be read, or states no PMI.
    """
    geometry = part.geometry
    source = geometry.source if isinstance(geometry, Mesh) else None
    if not (isinstance(source, str | Path) and Path(source).suffix.lower() in STEP):
        raise ModelError(part.name, [f'part "{part.name}" is a {geometry}; only a STEP file of AP242 states PMI'])
    try:
        pmi = read_pmi(source)
        read = shape(geometry)
    except (OptionError, GeometryFault) as error:
        raise ModelError(part.name, [f'part "{part.name}": {error}']) from error
    if pmi.is_empty:
        raise ModelError(part.name, [f'part "{part.name}": its file states no tolerances, dimensions or datums as AP242 does'])
    features, claims = declare_features(part, pmi, read)
    return DeclaredPmi(features, tuple(claim.result for claim in claims))


def declare_features(part: Part, pmi: Pmi, read: Shape) -> tuple[tuple[Feature, ...], list[Claim]]:
    """Declare the features that PMI states of a part with a shape; return them, and what became of each annotation."""
    surfaces = TolerancedSurfaces(read)
    claims = claims_of(pmi, surfaces)
    return _declare(part, {part: read.mesh}, claims, surfaces), claims


@dataclass
class _Draft:
    """A feature without its tolerances, its datum's claim, and the tolerances that it may state, each with its claim."""

    feature: Feature
    geometry: FeatureGeometry
    datum: Claim | None = None
    stated: list[tuple[Claim, Constituent]] = field(default_factory=list)

    @property
    def letters(self) -> set[str]:
        """The letters of the datums to which its tolerances refer."""
        return {letter for _, constituent in self.stated for letter in _letters(constituent)}


def _declare(part: Part, meshes: Meshes, claims: Sequence[Claim], surfaces: TolerancedSurfaces) -> tuple[Feature, ...]:
    """Declare the features that claims state, and write into the claims which features state them, or why none does."""
    drafts: dict[Place, _Draft] = {}
    for claim in claims:
        for place in claim.places:
            try:
                if place not in drafts:
                    drafts[place] = _draft(part, meshes, place, surfaces)
                _state(claim, drafts[place])
            except (Undeclared, GeometryFault) as reason:
                claim.reasons.append(f"faces {_numbers(place)}: {reason}" if len(claim.places) > 1 else str(reason))
    trial = Features(0)
    for feature in datum_order(part)[0]:
        trial.add(feature, 0, meshes)
    tried = [_tried(draft, trial, meshes) for draft in _in_order(drafts.values(), part)]
    declared = tuple(feature for feature in tried if feature is not None)
    part.add(*declared)
    return declared


def _draft(part: Part, meshes: Meshes, place: Place, surfaces: TolerancedSurfaces) -> _Draft:
    """Return a draft of the feature at a place. Raises GeometryFault if the place is no feature."""
    faces = tuple(Face(part, (Brep(*sorted(surface)),)) for surface in place)
    geometry = feature_geometry([patch(face, meshes) for face in faces])
    kind = "surface" if isinstance(geometry, GeneralFeature) else surfaces.kind(place[0])
    if isinstance(geometry, SlabFeature):
        kind = "slot" if geometry.is_inner else "tab"
    name = f"{kind} {min(min(surface) for surface in place)}"
    return _Draft(Feature(name, part, faces, declared_at=script_line()), geometry)


def _state(claim: Claim, draft: _Draft) -> None:
    """Add what a claim states to a draft. Raises Undeclared."""
    match claim.annotation:
        case Datum() as datum:
            if len(claim.places) > 1:
                raise Undeclared("it is a datum of several surfaces")
            if draft.feature.datum is not None:
                raise Undeclared(f"its surface is datum {draft.feature.datum} already")
            draft.feature, draft.datum = replace(draft.feature, name=datum.letter, datum=datum.letter), claim
        case Dimension() as dimension:
            if not isinstance(draft.geometry, FeatureOfSize):
                raise Undeclared(
                    f"a size is for cylinders, spheres and two opposed planes, and it is {draft.geometry.in_words}"
                )
            draft.stated.append((claim, declarable.size(dimension, draft.geometry.size)))
        case tolerance:
            draft.stated.append((claim, declarable.tolerance(tolerance, is_axis=isinstance(draft.geometry, AxisFeature))))


def _in_order(drafts: Iterable[_Draft], part: Part) -> Iterator[_Draft]:
    """Yield drafts after those of their datums. Tolerances to datums that no draft is are taken away, with the reason."""
    waiting, made = list(drafts), {feature.datum for feature in part.features}
    while waiting:
        ready = [draft for draft in waiting if draft.letters <= made]
        yield from ready
        waiting = [draft for draft in waiting if draft not in ready]
        made |= {draft.feature.datum for draft in ready}
        if not ready:
            _take_away(waiting, made)


def _take_away(waiting: Sequence[_Draft], made: set[str | None]) -> None:
    """Take tolerances from drafts that wait: those to datums that nothing is, else those of the first draft in a circle."""
    possible = made | {draft.feature.datum for draft in waiting}
    is_circle = all(draft.letters <= possible for draft in waiting)
    for draft in waiting[:1] if is_circle else waiting:
        kept = []
        for claim, tolerance in draft.stated:
            absent = _letters(tolerance) - (made if is_circle else possible)
            if absent:
                reason = "refers back to it" if is_circle else "is not declared"
                claim.reasons.append(f"datum {min(absent)} {reason}")
            else:
                kept.append((claim, tolerance))
        draft.stated = kept


def _tried(draft: _Draft, trial: Features, meshes: Meshes) -> Feature | None:
    """Return a feature with all that it can state together; None if that is nothing."""
    feature = draft.feature
    for claim, constituent in sorted(draft.stated, key=lambda stated: not isinstance(stated[1], Size)):
        candidate = replace(feature, tolerances=(*feature.tolerances, constituent))
        reason = next(candidate.faults(), "") or _fault(candidate, trial, meshes)
        if reason:
            claim.reasons.append(f"{feature.name}: {reason}" if len(claim.places) > 1 else reason)
        else:
            claim.features.append(feature.name)
            feature = candidate
    reason = _fault(feature, trial, meshes) if draft.datum else ""
    if draft.datum and reason:
        draft.datum.reasons.append(reason)
    if reason or not (feature.tolerances or feature.datum):
        return None
    if draft.datum:
        draft.datum.features.append(feature.name)
    trial.add(feature, 0, meshes)
    return feature


def _fault(feature: Feature, trial: Features, meshes: Meshes) -> str:
    """Return why a feature cannot be added to those that are declared before it; "" if it can."""
    try:
        trial.add(feature, 0, meshes)
    except GeometryFault as fault:
        return str(fault)
    trial.features.pop()
    return ""


def _letters(constituent: Constituent) -> set[str]:
    """Return the letters of the datums to which a tolerance refers."""
    if isinstance(constituent, Size):
        return set()
    return {letter for compartment in constituent.system for letter in compartment}


def _numbers(place: Place) -> str:
    return ", ".join(map(str, sorted(number for surface in place for number in surface)))
