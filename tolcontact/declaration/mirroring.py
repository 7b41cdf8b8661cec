"""Mirror images of parts, such as left and right doors, with all that is declared of these parts alone."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal, get_args

from scipy.spatial.transform import Rotation

from tolcontact.declaration.contact_pair import MIN_PARTS, ContactPair, Force, Overlap
from tolcontact.declaration.declarations import expect
from tolcontact.declaration.geometry import Elastic
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne
from tolcontact.declaration.part import DatumTargets, Face, Feature, Part, Pattern, Point
from tolcontact.declaration.selection import Near
from tolcontact.declaration.values import Vector, is_length, script_line

Plane = Literal["x", "y", "z"]
PLANES: tuple[Plane, ...] = get_args(Plane)
HALF_TURN = 180.0  # degrees
COMPOSED = (  # declarations that refer to parts and features, and what they consist of
    Feature, Pattern, DatumTargets, Elastic, Location, ThreeTwoOne, Locator, ContactPair, Force, Overlap, Face, Near, Point,
)  # fmt: skip


@dataclass(frozen=True)
class MirrorPlane:
    """A mirror plane of the nominal assembly, and the images that it has made.

    axis       axis of the assembly that is normal to it
    at         [mm] its coordinate on this axis
    names      a text in names, and the text in its place in names of images
    images     of parts, and of features, also of members of patterns
    line       of the script
    """

    axis: Plane
    at: float
    names: Sequence[str]
    images: dict[Part | Feature, Any] = field(default_factory=dict)
    line: str = field(default_factory=script_line)

    def name(self, name: str) -> str:
        """Return the name of an image: with the text replaced, or added if the name lacks it."""
        old, new = self.names
        return name.replace(old, new) if old in name else f"{name} {new}"

    def vector(self, vector: Vector, shift: float = 0.0) -> Vector:
        """Return a vector with its component along the axis reversed, and shifted [mm]."""
        x, y, z = (shift - c if axis == self.axis else c for axis, c in zip(PLANES, vector, strict=True))
        return x, y, z

    def part(self, part: Part) -> Part:
        """Return the image of a part without its features."""
        rotation = self.vector(part.rotation)
        rotation = (0.0 - rotation[0], 0.0 - rotation[1], 0.0 - rotation[2])
        if part.mirror not in ("", self.axis):  # two mirrors are half a turn about the third axis
            turn = [HALF_TURN * (axis not in (part.mirror, self.axis)) for axis in PLANES]
            x, y, z = (Rotation.from_rotvec(rotation) * Rotation.from_rotvec(turn, degrees=True)).as_rotvec().tolist()
            rotation = x, y, z
        at, mirror = self.vector(part.at, 2 * self.at), "" if part.mirror else self.axis
        return replace(part, name=self.name(part.name), at=at, rotation=rotation, mirror=mirror, declared_at=self.line)

    def image(self, value: Any) -> Any:
        """Return the image of a value of a declaration; None for a feature without an image."""
        if isinstance(value, Part | Feature):
            return self.images.get(value, value if isinstance(value, Part) else None)
        if type(value) is tuple:
            return tuple(map(self.image, value))
        return self.composed(value) if isinstance(value, COMPOSED) else value

    def composed(self, declared: Any) -> Any:
        """Return the image of a declaration. Coordinates in the frame of its part are the same."""
        values = {field.name: self.image(getattr(declared, field.name)) for field in fields(declared)}
        if "declared_at" in values:
            values["declared_at"] = self.line
        if isinstance(declared, ContactPair | Force):
            values["name"] = self.name(declared.name)
        if isinstance(declared, Force):
            values["vector"] = self.vector(declared.vector)
        return replace(declared, **values)

    def settings(self, assembly: Any) -> Iterator[tuple[str, Any]]:
        """Yield the images of locations, contact pairs, forces and overlaps of the parts alone, by the names of their lists."""
        for location in assembly.locations:
            is_on_image = not isinstance(location.on, Feature) or location.on in self.images
            if location.part in self.images and is_on_image and not location.joint:
                yield "locations", self.composed(location)
        for pair in assembly.pairs:
            if {pair.moving.part, pair.reference.part} <= self.images.keys():
                yield "pairs", self.composed(pair)
        for force in assembly.forces:
            if force.at.part in self.images:
                yield "forces", self.composed(force)
        for overlap in assembly.overlaps:
            parts = tuple(part for part in overlap.parts if part in self.images)
            if len(parts) >= MIN_PARTS:
                yield "overlaps", self.composed(replace(overlap, parts=parts))


def mirrored(assembly: Any, parts: Sequence[Part], plane: Plane, names: Sequence[str], at: float) -> Any:
    """Add the mirror images of parts to an assembly, and return them (see Assembly.mirrored)."""
    for part in parts:
        expect("mirrored: an argument", part, Part, "parts, as in mirrored(left, plane=..., names=...)")
        if part not in assembly.parts:
            raise ValueError(f'mirrored: part "{part.name}" is no part of "{assembly.name}"; take one of it')
    if not parts or len(set(parts)) < len(parts):
        raise ValueError("mirrored: expected one part or more, each once, as in mirrored(left, plane=..., names=...)")
    if plane not in PLANES:
        raise ValueError(f'mirrored: plane is {plane!r}; expected the axis that is normal to it, "x", "y" or "z"')
    if not is_length(at):
        raise ValueError(f"mirrored: at is {at!r}; expected a coordinate in mm")
    is_pair = isinstance(names, tuple | list) and len(names) == 2 and all(isinstance(text, str) and text for text in names)
    if not is_pair or names[0] == names[1]:
        raise ValueError(f'mirrored: names is {names!r}; expected two different texts, as in names=("left", "right")')
    mirror = MirrorPlane(plane, float(at), names)
    mirror.images.update({part: assembly._add("parts", mirror.part(part)) for part in parts})
    for part in parts:
        for declared in part._declared:
            added = mirror.images[part].add(mirror.composed(declared))
            if isinstance(declared, Feature | Pattern):
                mirror.images.update(zip(declared.members, added.members, strict=True))
    for name, thing in list(mirror.settings(assembly)):  # all images are composed before the first is added
        assembly._add(name, thing)
    images = tuple(mirror.images[part] for part in parts)
    return images[0] if len(images) == 1 else images
