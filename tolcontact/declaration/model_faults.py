"""The faults of a declared assembly and of the sequence of its stations, beyond those that each declaration finds itself."""

from collections.abc import Iterator, Sequence
from typing import Any

from tolcontact.declaration.contact_pair import Joint
from tolcontact.declaration.declarations import SETTINGS, Station, joined_before, present_parts, settings_of
from tolcontact.declaration.locator import Location
from tolcontact.declaration.part import Part
from tolcontact.declaration.values import group_faults, is_finite, key_faults, repetitions

Line = Any  # an assembly; its module imports this one
KEYED = {"part": "parts", "contact pair": "pairs", "measurement": "measures", "force": "forces"}  # by names in the archive


def omissions(assembly: Line) -> Iterator[str]:
    """Yield the faults of a model that is not complete yet: declarations that only a run needs."""
    if not assembly.measures:
        yield "it measures nothing; declare at least one measurement with assembly.measure(...)"
    advice = "it is not located; call locate(...), or declare it fixed=True to hold it at its nominal place"
    for part in assembly.parts:
        if assembly.location_of(part) is None and part.fixed is not True:
            yield from part.located_faults(iter([advice]))


def setting_faults(assembly: Line) -> Iterator[str]:
    """Yield the faults of the title block and of gravity."""
    yield from (f"title block: {fault}" for fault in (assembly.title_block.faults() if assembly.title_block else ()))
    if assembly.acceleration is not None:
        if not (is_finite(assembly.acceleration) and any(assembly.acceleration)):
            yield (
                f"gravity is {assembly.acceleration!r}; expected a nonzero acceleration [m/s^2], as in gravity((0, 0, -9.81))"
            )
        elif not any(part.elasticity for part in assembly.parts):
            advice = "declare the weights of rigid parts with assembly.force(...)"
            yield f"it has gravity, which acts on elastic parts alone; {advice}"


def declaration_faults(assembly: Line) -> Iterator[str]:
    """Yield the faults of all declarations, with their script lines."""
    for kind, name in KEYED.items():
        yield from key_faults(kind, [thing.name for thing in getattr(assembly, name)])
    yield from group_faults("part", [part.name for part in assembly.parts])
    for part in assembly.parts:
        yield from part.located_faults()
        if not assembly.stations:
            count = sum(location.part is part for location in assembly.locations)
            if count > 1:
                yield from part.located_faults(iter([f"it is located {count} times; locate it once"]))
            yield from part.located_faults(_location_faults(assembly, part))
        yield from _feature_faults(part)
    for thing in (*assembly.locations, *assembly.pairs, *assembly.forces, *assembly.measures, *assembly.overlaps):
        yield from thing.located_faults()
        label = f'locators of "{thing.name}"' if isinstance(thing, Location) else f'{thing.noun} "{thing.name}"'
        for part in thing.parts:
            if part is not None and part not in assembly.parts:
                names = ", ".join(member.name for member in assembly.parts) or "none"
                unknown = f'unknown part "{getattr(part, "name", part)}"'
                yield f'{label} ({thing.declared_at}): {unknown}; the parts of "{assembly.name}" are: {names}'
    for cause in (*assembly.variables, *assembly.correlations, *assembly.populations):
        yield from cause.located_faults()
    yield from key_faults("variable", [variable.name for variable in assembly.variables])
    for number, measure in enumerate(assembly.measures):
        earlier = [other for other in assembly.measures[:number] if other.station == measure.station]
        yield from measure.located_faults(measure.reference_faults(earlier))
    if assembly.stations:
        yield from _sequence_faults(assembly)
        for scene in assembly.scenes:
            yield from (fault for part in scene.parts for fault in part.located_faults(_location_faults(scene, part)))


def _feature_faults(part: Part) -> Iterator[str]:
    owner = f'part "{part.name}": '
    letters = [declared.datum for declared in part.toleranced if declared.datum] + [datum.letter for datum in part.targets]
    names = [declared.name for declared in dict.fromkeys((*part.toleranced, *part.features))]
    yield from key_faults(f"{owner}feature", names)
    yield from repetitions(f"{owner}datum", letters)
    for datum in part.targets:
        yield from datum.located_faults(owner=owner)
        for feature in datum.features:
            if feature not in part.features:
                yield (
                    f'{owner}datum "{datum.letter}" ({datum.declared_at}): its target is on feature '
                    f'"{feature.name}", which is no feature of the part; take one of the part'
                )
    for declared in part.toleranced:
        yield from declared.located_faults(owner=owner)
        for tolerance in declared.geometric:
            for letter in tolerance.letters:
                if letter not in letters:
                    datums = ", ".join(sorted(set(letters))) or "none"
                    yield (
                        f"{owner}{declared.designation}: {tolerance.kind} refers to datum {letter}, which no feature of the "
                        f'part is; its datums are: {datums}; declare it with part.feature(..., datum="{letter}")'
                    )


def _location_faults(scene: Line, part: Part) -> Iterator[str]:
    location = scene.location_of(part)
    if location is not None and location.floating:
        body = scene.body_of(part)
        touches = any(side.part in body for pair in scene.pairs for side in (pair.moving, pair.reference))
        if not (touches or location.has_supports):
            yield (
                "it is floating, in no contact pair and on no one-sided locator, so nothing decides its place; "
                "declare its contacts"
            )
        if part.fixed is True:
            yield "it is floating, so contact has to move it; leave fixed out"
    first, *rest = scene.support_chain(part)
    if first in rest:
        circle = " on ".join(f'"{link.name}"' for link in (first, *rest))
        yield f"it is located on itself: {circle}; locate one of them on another part, or on the ground"


def _sequence_faults(line: Line) -> Iterator[str]:
    """Yield the faults of the sequence: each names the station, the part and the script line."""
    names = [station.name for station in line.stations]
    yield from key_faults("station", names)
    yield from group_faults("station", names)
    yield from key_faults("joint", [joint.name for joint in line.joints])
    yield from repetitions("part or joint", [part.name for part in line.parts] + [joint.name for joint in line.joints])
    for list_name, method in SETTINGS.items():
        for thing in getattr(line, list_name):
            if thing.station not in names:
                yield f"{thing.designation} belongs to no station; declare it in one: station.{method}(...)"
    for joint in line.joints:
        yield from joint.located_faults()
        if joint.station not in names:
            yield f'{joint.designation} refers to station "{joint.station}"; the stations are: {", ".join(names)}'
    for station in line.stations:
        yield from _station_faults(line, station)


def _station_faults(line: Line, station: Station) -> Iterator[str]:
    joined, settings = joined_before(line, station), settings_of(line, station)
    if not settings["locations"]:
        yield f"{station.designation}: it locates nothing; call {station.name}.locate(...)"
    bodies: dict[Joint | Part, Location] = {}
    for location in settings["locations"]:
        yield from location.located_faults(_locating_faults(location, joined, station))
        first = bodies.setdefault(joined.get(location.part, location.part), location)
        if first is not location:
            line_of_first = first.declared_at or "an earlier location"
            fault = f'station "{station.name}" locates it twice, first in {line_of_first}; locate it once'
            yield f"{location.designation}: {fault}"
    present = present_parts(line, station)
    for things in settings.values():
        for thing in things:
            for part in dict.fromkeys(thing.parts):
                if part in line.parts and part not in present and not (isinstance(thing, Location) and part is thing.part):
                    yield f"{thing.designation}: {_absence(part, joined, station)}"
    yield from _join_faults(line, station, present)


def _locating_faults(location: Location, joined: dict[Part, Joint], station: Station) -> Iterator[str]:
    joint = joined.get(location.part)
    if joint is not None and location.joint != joint.name:
        body = f'joint "{location.joint}"' if location.joint else f'part "{location.part.name}"'
        yield (
            f'station "{station.name}" locates {body}, which is in joint "{joint.name}" since station "{joint.station}"; '
            "locate that joint"
        )
    elif joint is None and location.joint:
        yield f'station "{station.name}" locates joint "{location.joint}", which no earlier station joins'
    elif joint is not None:
        names = ", ".join(part.name for part in joint.members)
        places = {f'locator "{locator.name}" is at a point': locator.part for locator in location.locators}
        places |= {f"face {face} is": face.part for face in location.faces}
        for place, part in places.items():
            if part is not None and part not in joint.members:
                yield f'{place} of part "{part.name}"; the parts of the joint are: {names}'
    if joint is not None and location.parent in joint.members:
        yield f'joint "{joint.name}" is located on its own part "{location.parent.name if location.parent else ""}"'


def _join_faults(line: Line, station: Station, present: Sequence[Part]) -> Iterator[str]:
    before = joined_before(line, station)
    joints: dict[Part, Joint] = {}
    for joint in line.joints:
        if joint.station != station.name:
            continue
        place = joint.designation
        for part in dict.fromkeys(joint.members):
            if part in joints:
                yield (
                    f'{place}: station "{station.name}" joins part "{part.name}" twice, first in joint "{joints[part].name}" '
                    f"({joints[part].declared_at}); join all in one joint"
                )
                break
            elif part not in present:
                yield f"{place}: {_absence(part, before, station)}"
            elif part in before and not set(before[part].members) <= set(joint.members):
                yield (
                    f'{place}: station "{station.name}" joins part "{part.name}", which is in joint "{before[part].name}" '
                    f'since station "{before[part].station}"; join that joint'
                )
            joints.setdefault(part, joint)


def _absence(part: Part, joined: dict[Part, Joint], station: Station) -> str:
    """Return the fault of a part that a station needs and does not hold."""
    body = f'joint "{joined[part].name}" with part "{part.name}"' if part in joined else f'part "{part.name}"'
    return f'station "{station.name}" does not hold {body}; locate it there: {station.name}.locate(...)'
