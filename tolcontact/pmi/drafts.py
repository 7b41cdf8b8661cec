"""Declaration of features, patterns and datum targets of a part from the PMI of its file.

Annotations of one surface make up a draft. Drafts become features one after the other, each after its datums and with as many
of its tolerances as are compatible; the claims of the others get the reasons. The part gets each feature as it is made, since
patterns ask it for their members.
"""

from collections import defaultdict
from collections.abc import Collection, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace

from tolcontact.declaration import Brep, DatumTargets, Face, Feature, Part, Pattern
from tolcontact.declaration.size import Size
from tolcontact.declaration.toleranced import Control
from tolcontact.declaration.values import Vector
from tolcontact.errors import GeometryFault
from tolcontact.features import Features, datum_order
from tolcontact.features.datum_frames import Declared
from tolcontact.features.feature_geometry import AxisFeature, FeatureGeometry, FeatureOfSize, SlabFeature
from tolcontact.features.feature_recognition import feature_geometry
from tolcontact.features.nominal_pattern import unlike_members
from tolcontact.geometry.faces import Meshes, patch
from tolcontact.geometry.files import Shape
from tolcontact.pmi.annotations import Datum, Dimension, Pmi, Tolerance
from tolcontact.pmi.claims import Claim, Place, TolerancedSurfaces, Undeclared, claims_of, declared_size, declared_tolerance

Statement = tuple[Claim, Control]


@dataclass(eq=False)
class Draft:
    """A feature, a pattern of several members or targets of a datum, and the tolerances that it may state, with their claims.

    faces       of each member
    geometries  of each member
    datum       claim of the datum that it is
    borrowed    drafts whose features make up a pattern that is a datum alone, or have the targets
    targets     points of a datum, one for each of `borrowed`
    """

    name: str
    faces: tuple[tuple[Face, ...], ...] = ()
    geometries: tuple[FeatureGeometry, ...] = ()
    datum: Claim | None = None
    stated: tuple[Statement, ...] = ()
    borrowed: "tuple[Draft, ...]" = ()
    targets: tuple[Vector, ...] = ()

    @property
    def letter(self) -> str | None:
        """The letter of the datum that it is."""
        return self.datum.annotation.letter if self.datum and isinstance(self.datum.annotation, Datum) else None

    def add(self, claim: Claim) -> None:
        """Add what a claim states of a feature. Raises Undeclared."""
        (geometry,) = self.geometries
        match claim.annotation:
            case Datum() if len(claim.places) > 1 or claim.targets:
                pass
            case Datum() if self.letter is not None:
                raise Undeclared(f"its surface is datum {self.letter} already")
            case Datum():
                self.datum = claim
            case Dimension() as dimension:
                if not isinstance(geometry, FeatureOfSize):
                    kind = self.name.partition(" ")[0]
                    raise Undeclared(
                        f"sizes of features are those of cylinders, spheres and two opposed planes, and it is a {kind}"
                    )
                self.stated += ((claim, declared_size(dimension, geometry.size, is_inner=geometry.is_inner)),)
            case tolerance:
                self.stated += ((claim, declared_tolerance(tolerance, is_axis=isinstance(geometry, AxisFeature))),)


def declare_features(part: Part, pmi: Pmi, read: Shape, line: str = "") -> tuple[tuple[Declared, ...], list[Claim]]:
    """Declare the features that PMI states of a part with a shape, by a line of a script; return them and all claims."""
    surfaces = TolerancedSurfaces(read)
    claims = claims_of(pmi, surfaces)
    drafts = _drafts(part, {part: read}, claims, surfaces)
    declared = _Trial(part, {part: read}, line).features(drafts)
    return tuple(declared[draft] for draft in drafts if draft in declared), claims


def _drafts(part: Part, meshes: Meshes, claims: Sequence[Claim], surfaces: TolerancedSurfaces) -> list[Draft]:
    """Return drafts of the features and patterns of a part."""
    drafts: dict[Place, Draft] = {}
    for claim in claims:
        for place in claim.places:
            kind = "planes" if len(place) > 1 else surfaces.kind(place[0]).replace("general", "surface")
            name = f"{kind} {min(min(surface) for surface in place)}"
            try:
                if place not in drafts:
                    faces = tuple(Face(part, (Brep(*sorted(surface)),)) for surface in place)
                    geometry = feature_geometry([patch(face, meshes) for face in faces])
                    slab = isinstance(geometry, SlabFeature) and ("slot" if geometry.is_inner else "tab")
                    drafts[place] = Draft(name.replace("planes", slab) if slab else name, (faces,), (geometry,))
                drafts[place].add(claim)
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
    separate = [*common_datums, *(frozenset([place]) for claim in targeted for place in claim.places)]
    patterns = []
    for pattern, places in list(_patterns(drafts, separate)):
        pattern.datum = common_datums.pop(places, None)
        patterns.append(pattern)
        for place in places:
            del drafts[place]
    datum_drafts = [_common_datum(claim, drafts) for claim in (*common_datums.values(), *targeted)]
    return [*drafts.values(), *patterns, *datum_drafts]


def _patterns(drafts: Mapping[Place, Draft], datums: Collection[frozenset[Place]]) -> Iterator[tuple[Draft, frozenset[Place]]]:
    """Yield drafts of patterns with their places: of like features that state the same, with zones in fixed relative positions.

    Members of a datum of several surfaces are one pattern, or each is a feature.
    """
    groups: dict[tuple[Claim, ...], list[Place]] = defaultdict(list)
    for place, draft in drafts.items():
        claims = tuple(claim for claim, _ in draft.stated)
        if draft.datum is None and any(_keeps_together(claim) for claim in claims):
            groups[claims].append(place)
    for group in groups.values():
        places, members = frozenset(group), [drafts[place] for place in group]
        is_divided = any(places & datum and places != datum for datum in datums)
        geometries = tuple(geometry for member in members for geometry in member.geometries)
        if len(members) > 1 and not is_divided and not unlike_members(geometries):
            kind, number = members[0].name.split()
            faces = tuple(faces for member in members for faces in member.faces)
            yield Draft(f"{kind}s {number}", faces, geometries, stated=members[0].stated), places


def _keeps_together(claim: Claim) -> bool:
    """Return whether the zones of several features of a tolerance keep their relative positions, as in a pattern."""
    stated = claim.annotation
    return isinstance(stated, Tolerance) and (
        stated.kind == "position" or stated.refines is not None or "common zone" in stated.modifiers
    )


def _common_datum(claim: Claim, drafts: Mapping[Place, Draft]) -> Draft:
    """Return the draft of a datum of several surfaces, or of targets on them; each surface is a separate feature."""
    place_of = {number: place for place in claim.places for surface in place for number in surface}
    places = [place_of[number] for number, _ in claim.targets] or claim.places
    borrowed = tuple(drafts[place] for place in places)
    return Draft("", datum=claim, borrowed=borrowed, targets=tuple(point for _, point in claim.targets))


class _Trial:
    """The features of a part as numbers, and the drafts that become features one after the other."""

    def __init__(self, part: Part, meshes: Meshes, line: str) -> None:
        self._part, self._meshes, self._line = part, meshes, line
        self._numbers, self._declared = Features(0), dict[Draft, Declared]()
        for earlier in datum_order(part)[0]:
            self._numbers.add(earlier, 0, meshes)

    def features(self, drafts: Sequence[Draft]) -> dict[Draft, Declared]:
        """Declare the features of drafts, each after its datums and members, with the tolerances that are compatible."""
        needed = {member for draft in drafts for member in draft.borrowed}
        letters = {None, *self._numbers.datums(0)}
        known_letters = letters | {draft.letter for draft in drafts}
        for draft in drafts:
            _keep_following(draft, known_letters, "is not declared")
        waiting = list(drafts)
        while waiting:
            ready = [
                draft for draft in waiting
                if not any(set(control.letters) - letters for _, control in draft.stated)
                and not any(member in waiting for member in draft.borrowed)
            ]  # fmt: skip
            for draft in ready:
                declared = self._made(draft, is_needed=draft in needed)
                if declared is not None:
                    self._numbers.add(declared, 0, self._meshes)
                    self._declared[draft] = declared
                    self._part.add(declared)
            letters |= {draft.letter for draft in ready}
            waiting = [draft for draft in waiting if draft not in ready]
            if not ready:  # a circle: its first draft with tolerances goes without those that lead into it
                _keep_following(next(draft for draft in waiting if draft.stated), letters, "refers back to it")
        return self._declared

    def _made(self, draft: Draft, *, is_needed: bool) -> Declared | None:
        """Return a feature with all that it can state together; None if that is nothing."""
        datum, letter = draft.datum, draft.letter
        absent = [member.letter or member.name for member in draft.borrowed if member not in self._declared]
        if absent and datum:
            datum.refuse(f"of its surfaces, {', '.join(dict.fromkeys(absent))} could not be declared")
            return None
        if datum and letter in self._numbers.datums(0):
            datum.refuse(self._fault(self._feature(draft, letter, ())) or f"the part has a datum {letter} already")
            if draft.borrowed:
                return None
            datum, letter = None, None
        name, controls = letter or draft.name, tuple[Control, ...]()
        for claim, control in _sizes_first(draft.stated):
            is_implied = any(_implies(earlier, control) for earlier in controls)
            if not is_implied and (reason := self._fault(self._feature(draft, letter, (*controls, control)))):
                claim.refuse(reason, name)
            else:
                claim.names.append(name)
                controls += () if is_implied else (control,)
        if not (controls or datum or is_needed):
            return None
        declared = self._feature(draft, letter, controls)
        reason = self._fault(declared)
        if datum and reason:
            datum.refuse(reason)
        elif datum:
            datum.names.append(name)
        return None if reason else declared

    def _feature(self, draft: Draft, letter: str | None, controls: tuple[Control, ...]) -> Declared:
        """Return what a draft declares as a datum with a letter, or as none, with some tolerances."""
        name, part = letter or draft.name, self._part
        if len(draft.faces) == 1:
            return Feature(name, part, draft.faces[0], controls, letter, self._line)
        members = [self._declared.get(member) for member in draft.borrowed]
        borrowed = tuple(member for member in members if isinstance(member, Feature))
        if draft.targets:
            points = zip(borrowed, draft.targets, strict=True) if len(borrowed) == len(draft.targets) else ()
            return DatumTargets(name, tuple(feature.point(*point) for feature, point in points), self._line)
        return Pattern(name, part, borrowed or draft.faces, controls, letter, self._line)

    def _fault(self, declared: Declared) -> str:
        """Return why something cannot be added to what is declared before it; "" if it can."""
        for fault in declared.faults():
            return fault
        try:
            self._numbers.copy().add(declared, 0, self._meshes)
        except GeometryFault as error:
            return str(error)
        return ""


def _sizes_first(stated: Sequence[Statement]) -> list[Statement]:
    """Return statements with the sizes first, and those that narrower tolerances of the same kind imply last."""

    def place(statement: Statement) -> int:
        _, control = statement
        is_implied = any(_implies(other, control) and not _implies(control, other) for _, other in stated)
        return 0 if isinstance(control, Size) else 2 if is_implied else 1

    return sorted(stated, key=place)


def _implies(other: Control, stated: Control) -> bool:
    """Return whether a tolerance implies a stated one: all but the widths are equal, and it is not wider."""
    if isinstance(other, Size) or isinstance(stated, Size):
        return False
    return other.width <= stated.width and replace(stated, width=other.width) == other


def _keep_following(draft: Draft, letters: Set[str | None], reason: str) -> None:
    """Keep the statements of a draft that refer to datums with some letters only; the claims of the others are refused."""
    for claim, control in draft.stated:
        if missing := set(control.letters) - letters:
            claim.refuse(f"datum {min(missing)} {reason}", draft.name)
    draft.stated = tuple(statement for statement in draft.stated if not set(statement[1].letters) - letters)
