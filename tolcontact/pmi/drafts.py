"""Drafts of the features and patterns that annotations of a file state, before their tolerances are tried together."""

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field

from tolcontact.declaration import Brep, DatumTargets, Face, Feature, Part, Pattern
from tolcontact.declaration.feature_tolerance import GeometricTolerance
from tolcontact.declaration.size import Size
from tolcontact.declaration.values import Vector, script_line
from tolcontact.errors import GeometryFault
from tolcontact.features.feature_geometry import AxisFeature, FeatureGeometry, FeatureOfSize, SlabFeature
from tolcontact.features.feature_recognition import feature_geometry
from tolcontact.features.pattern_geometry import check_alike
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.pmi import declarable
from tolcontact.pmi.annotations import Datum, Dimension, Tolerance
from tolcontact.pmi.claims import Claim, Place
from tolcontact.pmi.declarable import Undeclared
from tolcontact.pmi.toleranced_surfaces import TolerancedSurfaces

Constituent = Size | GeometricTolerance
Declared = Feature | Pattern | DatumTargets


@dataclass(eq=False)
class Draft:
    """A feature, a pattern of several members or targets of a datum, and the tolerances that it may state, with their claims.

    faces       of each member
    geometries  of each member
    datum       claim of the datum that it is
    borrowed    drafts whose features make up a pattern that is a datum alone, or on which targets are
    targets     points of a datum, one for each of `borrowed`
    is_needed   whether it is to be declared even without tolerances
    declared    what it became
    """

    name: str
    faces: list[tuple[Face, ...]] = field(default_factory=list)
    geometries: list[FeatureGeometry] = field(default_factory=list)
    datum: Claim | None = None
    stated: list[tuple[Claim, Constituent]] = field(default_factory=list)
    borrowed: "tuple[Draft, ...]" = ()
    targets: tuple[Vector, ...] = ()
    is_needed: bool = False
    declared: Declared | None = None

    @property
    def letter(self) -> str | None:
        """The letter of the datum that it is."""
        return self.datum.annotation.letter if self.datum and isinstance(self.datum.annotation, Datum) else None

    @property
    def letters(self) -> set[str]:
        """The letters of the datums to which its tolerances refer."""
        return {letter for _, constituent in self.stated for letter in letters_of(constituent)}

    def with_tolerances(self, part: Part, tolerances: tuple[Constituent, ...]) -> Declared:
        """Return what it declares with some tolerances."""
        name = self.letter or self.name
        if len(self.faces) == 1:
            return Feature(name, part, self.faces[0], tolerances, self.letter, script_line())
        borrowed = tuple(draft.declared for draft in self.borrowed if isinstance(draft.declared, Feature))
        if self.targets:
            points = zip(borrowed, self.targets, strict=True) if len(borrowed) == len(self.targets) else ()
            return DatumTargets(name, tuple(feature.point(*point) for feature, point in points), script_line())
        return Pattern(name, part, borrowed or tuple(self.faces), tolerances, self.letter, script_line())


def letters_of(constituent: Constituent) -> set[str]:
    """Return the letters of the datums to which a tolerance refers."""
    if isinstance(constituent, Size):
        return set()
    return {letter for compartment in constituent.system for letter in compartment}


def drafts_of(part: Part, meshes: Meshes, claims: Sequence[Claim], surfaces: TolerancedSurfaces) -> list[Draft]:
    """Return drafts of the features and patterns of a part. Claims that cannot be stated get the reasons."""
    drafts: dict[Place, Draft] = {}
    for claim in claims:
        for place in claim.places:
            name = f"{_kind(place, surfaces)} {min(min(surface) for surface in place)}"
            try:
                if place not in drafts:
                    drafts[place] = _draft(name, part, meshes, place)
                _state(claim, drafts[place])
            except (Undeclared, GeometryFault) as reason:
                claim.refuse(reason, name)
    datums = [claim for claim in claims if isinstance(claim.annotation, Datum) and not claim.refusals]
    targeted = [claim for claim in datums if claim.targets]
    common_datums: dict[frozenset[Place], Claim] = {}
    for claim in datums:
        if len(claim.places) > 1 and not claim.targets:
            earlier = common_datums.setdefault(frozenset(claim.places), claim)
            if earlier is not claim and isinstance(earlier.annotation, Datum):
                claim.refuse(f"its surfaces are datum {earlier.annotation.letter} already")
    separate = [*common_datums.keys(), *(frozenset([place]) for claim in targeted for place in claim.places)]
    merged = list(_patterns(drafts, separate))
    for pattern, places in merged:
        pattern.datum = common_datums.pop(places, None)
        for place in places:
            del drafts[place]
    patterns = [pattern for pattern, _ in merged]
    datum_drafts = [_common_datum(claim, drafts) for claim in (*common_datums.values(), *targeted)]
    return [*drafts.values(), *patterns, *datum_drafts]


def _kind(place: Place, surfaces: TolerancedSurfaces) -> str:
    kind = "planes" if len(place) > 1 else surfaces.kind(place[0])
    return "surface" if kind == "general" else kind


def _draft(name: str, part: Part, meshes: Meshes, place: Place) -> Draft:
    """Return a draft of the feature at a place. Raises GeometryFault if the place is no feature."""
    faces = tuple(Face(part, (Brep(*sorted(surface)),)) for surface in place)
    geometry = feature_geometry([patch(face, meshes) for face in faces])
    if isinstance(geometry, SlabFeature):
        name = name.replace("planes", "slot" if geometry.is_inner else "tab")
    return Draft(name, [faces], [geometry])


def _state(claim: Claim, draft: Draft) -> None:
    """Add what a claim states to a draft of a feature. Raises Undeclared."""
    (geometry,) = draft.geometries
    match claim.annotation:
        case Datum():
            if len(claim.places) > 1 or claim.targets:
                return
            if draft.letter is not None:
                raise Undeclared(f"its surface is datum {draft.letter} already")
            draft.datum = claim
        case Dimension() as dimension:
            if not isinstance(geometry, FeatureOfSize):
                kind = draft.name.split()[0]
                raise Undeclared(
                    f"sizes of features are those of cylinders, spheres and two opposed planes, and it is a {kind}"
                )
            draft.stated.append((claim, declarable.size(dimension, geometry.size, is_inner=geometry.is_inner)))
        case tolerance:
            draft.stated.append((claim, declarable.tolerance(tolerance, is_axis=isinstance(geometry, AxisFeature))))


def _patterns(drafts: Mapping[Place, Draft], datums: Collection[frozenset[Place]]) -> Iterator[tuple[Draft, frozenset[Place]]]:
    """Yield drafts of patterns with their places: of like features that state the same, with zones that keep to each other.

    Members of a datum of several surfaces are one pattern, or each is a feature.
    """
    groups: dict[tuple[int, ...], list[Place]] = defaultdict(list)
    for place, draft in drafts.items():
        if draft.datum is None and any(_keeps_together(claim) for claim, _ in draft.stated):
            groups[tuple(id(claim) for claim, _ in draft.stated)].append(place)
    for group in groups.values():
        places, members = frozenset(group), [drafts[place] for place in group]
        is_divided = any(places & datum and places != datum for datum in datums)
        if len(members) > 1 and not is_divided and _are_alike(members):
            kind, number = members[0].name.split()
            faces = [faces for member in members for faces in member.faces]
            geometries = [geometry for member in members for geometry in member.geometries]
            yield Draft(f"{kind}s {number}", faces, geometries, stated=members[0].stated), places


def _keeps_together(claim: Claim) -> bool:
    """Return whether the zones of several features of a tolerance keep their places to each other, as those of a pattern do."""
    stated = claim.annotation
    return isinstance(stated, Tolerance) and (
        stated.kind == "position" or stated.refines is not None or "common zone" in stated.modifiers
    )


def _are_alike(members: Sequence[Draft]) -> bool:
    try:
        check_alike([geometry for member in members for geometry in member.geometries])
    except GeometryFault:
        return False
    return True


def _common_datum(claim: Claim, drafts: Mapping[Place, Draft]) -> Draft:
    """Return the draft of a datum of several surfaces, or of targets on them; each surface is a feature by itself."""
    place_of = {number: place for place in claim.places for surface in place for number in surface}
    places = [place_of[number] for number, _ in claim.targets] or claim.places
    borrowed = tuple(drafts[place] for place in places)
    for draft in borrowed:
        draft.is_needed = True
    return Draft("", datum=claim, borrowed=borrowed, targets=tuple(point for _, point in claim.targets))
