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
    presses    whether forces press the parts, so that two-sided locators with a stiffness are compliant
    """

    assembly: Assembly
    station: str
    first: int
    presses: bool

    def index(self, part: Part) -> int:
        """Return the index of a part of the scene among the parts of all scenes."""
        return self.first + self.assembly.parts.index(part)

    def parent(self, part: Part) -> int | None:
        """Return the index of the part that a part is located on, or of the first part of its joint; None on the ground."""
        carrier = self.assembly.body_of(part)[0]
        location = self.assembly.location_of(part)
        parent = carrier if carrier is not part else location.parent if location else None
        return self.index(parent) if parent in self.assembly.parts else None

    def movers(self, part: Part) -> tuple[int, ...]:
        """Return the indices of the free parts whose corrections move a part: those it is located on, then the part itself.

        A part of a joint of rigid parts is moved by the first part of the joint.
        """
        chain = dict.fromkeys(self.assembly.support_chain(part))
        if self.is_elastic(part):  # its body bends: its members move on their own
            chain = dict.fromkeys([part, *list(chain)[1:]])
        return tuple(self.index(link) for link in reversed(chain) if self.is_free(link) and self._touches(link))

    def is_free(self, part: Part) -> bool:
        """Return whether contact may move the part.

        Without a declared choice a part is free if it is a moving side, floats, has supports, or is elastic.
        """
        body = self.assembly.body_of(part)
        if any(member.fixed is not None for member in body):
            return any(member.fixed is False for member in body)
        location = self.assembly.location_of(part)
        floats = location is not None and location.floating
        is_moving = any(pair.moving.part in body for pair in self.assembly.pairs)
        return floats or is_moving or self.has_supports(part) or self.is_elastic(part)

    def is_elastic(self, part: Part) -> bool:
        """Return whether a part of its body is elastic, or the part that it is located on."""
        location = self.assembly.location_of(part)
        bodies = (*self.assembly.body_of(part), location.parent if location else None)
        return any(body is not None and body.elasticity is not None for body in bodies)

    def has_supports(self, part: Part) -> bool:
        """Return whether a locator of the part is one-sided, or is compliant because forces press the parts."""
        location = self.assembly.location_of(part)
        scheme = location.scheme if location is not None and isinstance(location.scheme, tuple) else ()
        return any(locator.one_sided or (self.presses and locator.stiffness is not None) for locator in scheme)

    def _touches(self, part: Part) -> bool:
        """Return whether something in the model holds or pushes the body of a part."""
        body = self.assembly.body_of(part)
        return (
            self.has_supports(part)
            or self.is_elastic(part)
            or any(side.part in body for pair in self.assembly.pairs for side in (pair.moving, pair.reference))
        )

    def supports_name(self, part: Part) -> str:
        """Return the name of the pair of the one-sided locators of a part."""
        return f"supports of {part.name}" + (f" in {self.station}" if self.station else "")

    def label(self, name: str) -> str:
        """Return a name that is unique although each station declares it again."""
        return f"{self.station}.{name}" if self.station else name


def scenes_of(assembly: Assembly, *, presses: bool) -> tuple[Scene, ...]:
    """Return the scenes of an assembly, in the order of its stations."""
    models = assembly.scenes
    names = [station.name for station in assembly.stations] or [""]
    starts = [sum(len(earlier.parts) for earlier in models[:k]) for k in range(len(models))]
    return tuple(Scene(*scene, presses) for scene in zip(models, names, starts, strict=True))


def joint_indices(scenes: Sequence[Scene], scene: Scene, part: Part) -> tuple[int, int] | None:
    """Return the indices of the first part of a joint and of another part of it, in the station that joined them; else None."""
    joint = next((joint for joint in scene.assembly.joints if part in joint.members[1:]), None)
    if joint is None:
        return None
    source = next(other for other in scenes if other.station == joint.station)
    return source.index(joint.first), source.index(part)
