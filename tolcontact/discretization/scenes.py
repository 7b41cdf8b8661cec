"""Scenes: the models of stations, which share one list of parts; and which parts contact may move in them."""

from collections.abc import Sequence
from dataclasses import dataclass

from tolcontact.declaration import Assembly, Part


@dataclass(frozen=True, eq=False)
class Scene:
    """The model of one station.

    assembly   what it declares
    station    its name; empty for an assembly without stations
    first      index of its first part among the parts of all scenes
    presses    whether forces press the parts, so that two-sided locators with a stiffness give way
    """

    assembly: Assembly
    station: str
    first: int
    presses: bool

    def index(self, part: Part) -> int:
        """Return the index of a part of the scene among the parts of all scenes."""
        return self.first + self.assembly.parts.index(part)

    def parent(self, part: Part) -> int | None:
        """Return the index of the part that carries a part, or that it is located on; None on the ground."""
        carrier = self.assembly.body_of(part)[0]
        location = self.assembly.location_of(part)
        parent = carrier if carrier is not part else location.parent if location else None
        return self.index(parent) if parent in self.assembly.parts else None

    def movers(self, part: Part) -> tuple[int, ...]:
        """Return the indices of the free parts whose corrections move a part."""
        return tuple(map(self.index, movers(self.assembly, part, springs=self.presses)))

    def label(self, name: str) -> str:
        """Return the name of something in this scene that is declared again in each station."""
        return f"{self.station}.{name}" if self.station else name


def scenes_of(assembly: Assembly, *, presses: bool) -> tuple[Scene, ...]:
    """Return the scenes of an assembly, in the order of its stations."""
    models = assembly.scenes
    names = [station.name for station in assembly.stations] or [""]
    starts = [sum(len(earlier.parts) for earlier in models[:k]) for k in range(len(models))]
    return tuple(Scene(*scene, presses) for scene in zip(models, names, starts, strict=True))


def carried(scenes: Sequence[Scene], scene: Scene, part: Part) -> tuple[int, int] | None:
    """Return the indices of the part that carries a part, and of itself, in the station that joined them; None by itself."""
    joint = next((joint for joint in scene.assembly.joints if part in joint.members[1:]), None)
    if joint is None:
        return None
    source = next(other for other in scenes if other.station == joint.station)
    return source.index(joint.first), source.index(part)


def is_free(assembly: Assembly, part: Part, *, springs: bool) -> bool:
    """Return True if contact may move the part.

    Without a declared choice a part is free if it is a moving side, floats, or has one-sided locators, or `springs` (see
    `has_supports`).
    """
    body = assembly.body_of(part)
    if any(member.fixed is not None for member in body):
        return any(member.fixed is False for member in body)
    location = assembly.location_of(part)
    floats = location is not None and location.floating
    return floats or any(pair.moving.part in body for pair in assembly.pairs) or has_supports(assembly, part, springs=springs)


def has_supports(assembly: Assembly, part: Part, *, springs: bool) -> bool:
    """Return True if a locator of the part is one-sided, or has a stiffness, if `springs` that give way to forces count."""
    location = assembly.location_of(part)
    scheme = location.scheme if location is not None and isinstance(location.scheme, tuple) else ()
    return any(locator.one_sided or (springs and locator.stiffness is not None) for locator in scheme)


def movers(assembly: Assembly, part: Part, *, springs: bool) -> tuple[Part, ...]:
    """Return the free parts whose corrections move `part`: the parts that it is located on, then the part itself.

    A part of a joint is moved by the first part of the joint. Locators that are `springs` count as supports.
    """
    chain = dict.fromkeys(assembly.support_chain(part))
    return tuple(link for link in reversed(chain) if _moves(assembly, link, springs=springs))


def _moves(assembly: Assembly, part: Part, *, springs: bool) -> bool:
    """Return True if the first part of a body is free, and something in the model holds it or pushes it."""
    body = assembly.body_of(part)
    touches = has_supports(assembly, part, springs=springs) or any(
        side.part in body for pair in assembly.pairs for side in (pair.moving, pair.reference)
    )
    return touches and is_free(assembly, part, springs=springs)
