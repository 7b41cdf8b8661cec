"""The check of drawings: what tolerances leave open, what has no effect, and what the simulation takes as perfect."""

from collections.abc import Iterator, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np

from tolcontact.declaration import GeometricTolerance, Pattern
from tolcontact.declaration.feature_tolerance import LineProfile, Profile
from tolcontact.discretization import Nominal
from tolcontact.features import FeatureOfSize, NominalPattern, PlaneFeature, datum_frame, uncontrolled

LISTED = 6  # freedoms or faces by name
LOCATED = "tc.Position or tc.Profile to datums that lock it"
ADVICE = {
    "offset": LOCATED, "shift": "tc.Position to datums that lock it", "common": LOCATED, "mixed": LOCATED,
    "tilt": "tc.Perpendicularity, tc.Parallelism or tc.Angularity, or a location",
    "relative": "a tolerance with combined zones",
}  # fmt: skip


class Remark(NamedTuple):
    """A remark on the drawing of a part; without a part, on all drawings.

    text   a sentence
    part   the name of the part
    noun   the kind of what the remark is on: "feature", "pattern" or "datum"
    name   the name of the feature or pattern, or the letter of the datum
    """

    text: str
    part: str = ""
    noun: str = ""
    name: str = ""


def drawing_remarks(nominal: Nominal) -> Iterator[str]:
    """Yield a sentence for everything that a checker would ask about the drawings of the parts."""
    makers = open_freedoms, missing_sizes, perfect_datums, unused_datums, ineffective_tolerances, perfect_faces
    subjects: dict[tuple[str, str, str], list[str]] = {}
    for text, part, noun, name in chain.from_iterable(make(nominal) for make in makers):
        subjects.setdefault((part, noun, text), []).append(name)
    for (part, noun, text), names in subjects.items():
        owner = f'part "{part}": ' if part else ""
        yield owner + (f"{noun}{'s' if len(names) > 1 else ''} {_listed(names)}: " if noun else "") + text


def open_freedoms(nominal: Nominal) -> Iterator[Remark]:
    """Yield a remark for each feature with freedoms that no tolerance limits; of a datum, those that it does not define."""
    for pattern in _stated(nominal):
        if isinstance(pattern.declared, Pattern) and pattern.declared.borrowed:
            continue  # these have tolerances of their own
        names = uncontrolled(pattern, _followed(nominal, pattern))
        if not names:
            continue
        declared, datum = pattern.declared, _letter(pattern)
        if not declared.geometric and datum is None:
            yield _remark(pattern, "no geometric tolerance limits its place in the part: taken as perfect")
            continue
        earlier = f" to the datums before {datum}" if datum else ""
        kinds = dict.fromkeys(name.split()[0] for name in names)
        advice = "; ".join(dict.fromkeys(ADVICE[kind] for kind in kinds if kind in ADVICE)) or ADVICE["relative"]
        own = [name.replace("mixed", "a combination of its freedoms") for name in names if name != "relative"]
        members = ["its members to each other"] if len(own) < len(names) else []
        limited = _listed([*members, *own]) + (earlier if own else "")
        yield _remark(pattern, f"no tolerance limits {limited}: taken as perfect; add {advice}")


def missing_sizes(nominal: Nominal) -> Iterator[Remark]:
    """Yield a remark for each toleranced hole, shaft, slot or tab whose size has no limits."""
    for pattern in _stated(nominal):
        geometry = pattern.geometries[0]
        if isinstance(geometry, FeatureOfSize) and pattern.declared.size is None and pattern.declared.tolerances:
            exact = f"it is {geometry.in_words} of exactly {geometry.size:.6g} mm"
            has_profile = any(tolerance.of in (Profile, LineProfile) for tolerance in pattern.declared.geometric)
            reason = "although its profile limits the size, too" if has_profile else "without limits of size"
            yield _remark(pattern, f"{exact}, {reason}; add tc.Size({geometry.size:.6g}, ...)")


def perfect_datums(nominal: Nominal) -> Iterator[Remark]:
    """Yield a remark for each part whose datum planes have no form: parts that stand on them do not rock."""
    for part in nominal.last_parts:
        flat = [
            str(pattern.declared.datum)
            for pattern in _stated(nominal)
            if pattern.declared.part is part.part and pattern.declared.datum
            and not all(any(one.limits_form_alone for one in member.geometric) for member in pattern.declared.members)
            and isinstance(pattern.geometries[0], PlaneFeature) and not isinstance(pattern.geometries[0], FeatureOfSize)
        ]  # fmt: skip
        if flat:
            yield Remark("no tolerance of form: taken as flat; add tc.Flatness", part.name, "datum", _listed(flat))


def unused_datums(nominal: Nominal) -> Iterator[Remark]:
    """Yield a remark for each datum letter that no tolerance refers to."""
    for part in nominal.last_parts:
        used = {letter for declared in part.part.toleranced for tolerance in declared.geometric for letter in tolerance.letters}
        letters = [declared.datum for declared in part.part.toleranced if declared.datum]
        letters += [targets.letter for targets in part.part.targets]
        if idle := [letter for letter in letters if letter not in used]:
            yield Remark("no tolerance refers to it; refer to it, or leave the letter out", part.name, "datum", _listed(idle))


def ineffective_tolerances(nominal: Nominal) -> Iterator[Remark]:
    """Yield a remark for each tolerance or modifier that cannot change a part."""
    for pattern in _stated(nominal):
        size = pattern.declared.size
        for tolerance in pattern.declared.geometric:
            if tolerance.is_form and size and pattern.declared.is_enveloped and size.upper - size.lower <= tolerance.width:
                limits = f"the size ({size.upper:+g} {size.lower:+g}), whose envelope limits the form already"
                yield _remark(pattern, f"{tolerance} is no finer than {limits}; make it finer, or leave it out")
            yield from (_remark(pattern, text) for text in _moot_modifiers(nominal, pattern, tolerance))


def perfect_faces(nominal: Nominal) -> Iterator[Remark]:
    """Yield one remark on the faces in contact pairs that no tolerance of a feature moves or shapes."""
    perfect: dict[str, list[str]] = {}
    for pair in nominal.pairs:
        for index, face in zip((pair.moving, pair.reference), pair.deviating, strict=True):
            if face is None and index is not None:
                perfect.setdefault(nominal.parts[index].name, []).append(pair.name)
    if perfect:
        faces = [f"{part} ({_listed(list(dict.fromkeys(pairs)))})" for part, pairs in perfect.items()]
        touched = f"no tolerance touches the faces in contact of {_listed(faces)}: taken as perfect"
        yield Remark(f"{touched}; if this is not meant, declare them as features with tolerances")


def _moot_modifiers(nominal: Nominal, pattern: NominalPattern, tolerance: GeometricTolerance) -> Iterator[str]:
    datums = nominal.datums(pattern.part)
    for letters, modifier in zip(tolerance.system, tolerance.modifiers, strict=True):
        features = [datum for letter in letters for datum in datums.get(letter, ())]
        if modifier and not all(isinstance(datum.geometry, FeatureOfSize) for datum in features):
            yield f"{tolerance}: datum {letters[0]} has no size, so a material modifier says nothing; leave it out"
        elif modifier and len(features) > 1:
            yield f"{tolerance}: datum {'-'.join(letters)} has several features: the play of its gauge is not drawn"


def _stated(nominal: Nominal) -> list[NominalPattern]:
    """Return the features and patterns of the drawings, without the gauge elements of datums."""
    return [pattern for pattern in nominal.patterns if not pattern.is_gauge]


def _followed(nominal: Nominal, pattern: NominalPattern) -> np.ndarray:
    """Return the directions (coordinate, n) of a datum that its frame follows: what the datums before it leave free.

    Datums whose own tolerances refer to it are left out: these limit them to it. Of a common datum the earlier letters count.
    """
    datums, letter = nominal.datums(pattern.part), _letter(pattern)
    if not letter:
        return np.zeros((pattern.count, 0))
    stated = [(declared.datum, one) for declared in pattern.declared.part.toleranced for one in declared.geometric]
    following = {datum for datum, tolerance in stated if letter in tolerance.letters}
    before = [
        [
            (letters, orientation_only)
            for letters, orientation_only in zip(
                (*tolerance.system[:k], named[: named.index(letter)]), tolerance.orientation_only, strict=False
            )
            if letters and not following & {*letters}
        ]
        for _, tolerance in stated
        for k, named in enumerate(tolerance.system)
        if letter in named
    ]
    places = max(before, key=len, default=[])
    if not places:
        return pattern.values
    system, orientation_only = zip(*places, strict=True)
    features = [[datum for letter in letters for datum in datums[letter]] for letters in system]
    frame = datum_frame(features, pattern.centre, pattern.reach, len(nominal.contributors), orientation_only)
    return pattern.values @ frame.free


def _letter(pattern: NominalPattern) -> str | None:
    """Return the letter of the datum that a feature or pattern is, or has targets of; None if it is no datum."""
    declared = pattern.declared
    targeted = (targets.letter for targets in declared.part.targets if {*targets.features} & {*declared.members})
    return declared.datum or next(targeted, None)


def _remark(pattern: NominalPattern, text: str) -> Remark:
    declared = pattern.declared
    return Remark(text, declared.part.name, declared.noun, declared.designation.removeprefix(f"{declared.noun} "))


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names[:LISTED]) + (f" and {len(names) - LISTED} more" if len(names) > LISTED else "")
