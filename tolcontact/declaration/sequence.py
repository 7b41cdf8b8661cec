"""Stations of an assembly that is built in steps: the parts and bodies in each, and the faults of their sequence.

A station is a separate model: its parts, with the locations, contact pairs, forces and measures that it declares, and the
joints that it locates.
"""

from collections.abc import Iterator, Sequence
from typing import Any, ClassVar

from tolcontact.declaration.checks import Declaration
from tolcontact.declaration.contact_pair import Joint, parts_of
from tolcontact.declaration.declarations import Declarations, expect
from tolcontact.declaration.locator import Location
from tolcontact.declaration.part import Part, Point
from tolcontact.declaration.values import group_faults, key_faults, repetitions, script_line

SETTINGS = {"locations": "locate", "pairs": "contact", "measures": "measure", "forces": "force"}  # lists, and their methods


Line = Any  # the assembly that the stations build; its module imports this one


class Station(Declarations, Declaration):
    """A step of building or measuring an assembly: `assembly.station(name)` declares it, in the order of the steps.

    Parts and joints are located again in each station; a station that only measures is an inspection. Features belong to parts:
    their deviations are equal in all stations. A locator is a separate contributor in each station, "weld.panel.A1".
    """

    name: str
    declared_at: str
    noun: ClassVar[str] = "station"

    def __init__(self, name: str, declared_at: str = "") -> None:
        self.name, self._station, self.declared_at = name, name, declared_at
        self._assembly: Declarations | None = None

    def belonging_to(self, assembly: Declarations) -> "Station":
        """Let the station declare into the lists of an assembly, and return it."""
        self._assembly = assembly
        return self

    def join(self, name: str, *bodies: Part | Joint, at: Sequence[Point] = (), pad: float | None = None) -> Joint:
        """Declare that `bodies`, parts or joints of earlier stations, are joined at the end of this station; return the joint.

        `weld.join("rail", left, right)` has the `name` "rail". Later stations locate the joint by points of any of its parts.
        Elastic parts are joined `at` points of one of them, each over a `pad` [mm] (see Joint).
        """
        for body in bodies:
            expect(f'join "{name}": a body', body, Part | Joint, "parts and joints, as in weld.join(name, left, right)")
        for point in at:
            expect(f'join "{name}": a point', point, Point, "part.point(x, y, z)")
        return self._add("joints", Joint(name, parts_of(bodies), self.name, script_line(), tuple(at), pad))

    @property
    def assembly(self) -> Any:
        if self._assembly is None:
            raise TypeError(f'station "{self.name}" belongs to no assembly; declare it with assembly.station(name)')
        return self._assembly

    def faults(self) -> Iterator[str]:
        if not isinstance(self.name, str):
            yield f"name is {self.name!r}; expected a text"

    def __str__(self) -> str:
        return f"station {self.name}"


def joined_before(line: Line, station: Station) -> dict[Part, Joint]:
    """Return the joint of each part that is joined when a station begins: the latest one."""
    names = [earlier.name for earlier in line.stations[: line.stations.index(station)]]
    # Two joints of one station are a fault; the first one counts.
    joints = [joint for name in names for joint in reversed(line.joints) if joint.station == name]
    return {part: joint for joint in joints for part in joint.members}


def settings_of(line: Line, station: Station) -> dict[str, list[Any]]:
    """Return the declarations of a station by the name of their list."""
    return {name: [thing for thing in getattr(line, name) if thing.station == station.name] for name in SETTINGS}


def in_order(line: Line) -> dict[str, list[Any]]:
    """Return the declarations of all stations by the name of their list, station by station."""
    of_stations = [settings_of(line, station) for station in line.stations]
    return {name: [thing for settings in of_stations for thing in settings[name]] for name in SETTINGS}


def present_parts(line: Line, station: Station) -> tuple[Part, ...]:
    """Return the parts in a station: those that it locates, with all parts of their joints, and fixed ones that it mentions.

    Parts that no station holds are in the first one.
    """
    present = _held_parts(line, station)
    if station is line.stations[0]:
        held = {part for other in line.stations for part in _held_parts(line, other)}
        present |= {part for part in line.parts if part not in held}
    return tuple(part for part in line.parts if part in present)


def _held_parts(line: Line, station: Station) -> set[Part]:
    joined, settings = joined_before(line, station), settings_of(line, station)
    located = {
        part
        for location in settings["locations"]
        for part in (joined[location.part].members if location.part in joined else (location.part,))
    }
    mentioned = {part for things in settings.values() for thing in things for part in thing.parts}
    return {part for part in line.parts if part in located or (part.fixed is True and part in mentioned)}


def sequence_faults(line: Line) -> Iterator[str]:
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
        yield from location.located_faults(_location_faults(location, joined, station))
        body = joined.get(location.part, location.part)
        if body in bodies:
            earlier = bodies[body].declared_at or "an earlier location"
            place = location.designation
            yield f'{place}: station "{station.name}" locates it twice, first in {earlier}; locate it once'
        bodies.setdefault(body, location)
    present = present_parts(line, station)
    for things in settings.values():
        for thing in things:
            for part in dict.fromkeys(thing.parts):
                if part in line.parts and part not in present and not (isinstance(thing, Location) and part is thing.part):
                    yield f"{thing.designation}: {_absence(part, joined, station)}"
    yield from _join_faults(line, station, present)


def _location_faults(location: Location, joined: dict[Part, Joint], station: Station) -> Iterator[str]:
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
