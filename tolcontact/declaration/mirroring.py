"""Mirror images of parts, such as left and right doors, with all that is declared of these parts alone."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from typing import Any, Literal, overload

from scipy.spatial.transform import Rotation

from tolcontact.declaration.causes import Causes
from tolcontact.declaration.contact_pair import MIN_PARTS, ContactPair, Force, Overlap
from tolcontact.declaration.declarations import expect
from tolcontact.declaration.elastic import Elastic
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne
from tolcontact.declaration.part import DatumTargets, Face, Feature, Part, Pattern, Point
from tolcontact.declaration.selection import Near
from tolcontact.declaration.values import Vector, is_length, script_line

Plane = Literal["x", "y", "z"]
PLANES: tuple[Plane, ...] = ("x", "y", "z")
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
    line       of the script
    parts      images of parts
    features   images of features, also of members of patterns
    """

    axis: Plane
    at: float
    names: Sequence[str]
    line: str
    parts: dict[Part, Part]
    features: dict[Feature, Feature]

    def name(self, name: str) -> str:
        """Return the name of an image: with the text replaced, or added if the name lacks it."""
        old, new = self.names
        return name.replace(old, new) if old in name else f"{name} {new}"

    def vector(self, vector: Vector, shift: float = 0.0) -> Vector:
        """Return a vector with its component along the axis reversed, and shifted [mm]."""
        x, y, z = (shift - c if axis == self.axis else c for axis, c in zip(PLANES, vector, strict=True))
        return x, y, z

    def add_part(self, part: Part) -> Part:
        """Add the image of a part without its features, and return it."""
        rotation = self.vector(part.rotation)
        rotation = (0.0 - rotation[0], 0.0 - rotation[1], 0.0 - rotation[2])
        if part.mirror not in ("", self.axis):  # two mirrors are half a turn about the third axis
            turn = [HALF_TURN * (axis not in (part.mirror, self.axis)) for axis in PLANES]
            x, y, z = (Rotation.from_rotvec(rotation) * Rotation.from_rotvec(turn, degrees=True)).as_rotvec().tolist()
            rotation = x, y, z
        at, mirror = self.vector(part.at, 2 * self.at), "" if part.mirror else self.axis
        image = replace(
            part, name=self.name(part.name), at=at, rotation=rotation, mirror=mirror, declared_at=self.line
        )  # fmt: skip
        self.parts[part] = image
        return image

    def image(self, value: Any) -> Any:
        """Return the image of a value of a declaration; None for a feature without an image."""
        if isinstance(value, Part):
            return self.parts.get(value, value)
        if isinstance(value, Feature):
            return self.features.get(value)
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

    def settings(self, declared: Mapping[str, Sequence[Any]]) -> Iterator[tuple[str, Any]]:
        """Yield the images of locations, contact pairs, forces and overlaps of the parts alone, by the names of their lists."""
        for location in declared["locations"]:
            is_on_image = not isinstance(location.on, Feature) or location.on in self.features
            if location.part in self.parts and is_on_image and not location.joint:
                yield "locations", self.composed(location)
        for name, kind in (("pairs", ContactPair), ("forces", Force)):
            for thing in declared[name]:
                parts = (thing.moving.part, thing.reference.part) if kind is ContactPair else thing.parts
                if all(part in self.parts for part in parts):
                    yield name, self.composed(thing)
        for overlap in declared["overlaps"]:
            parts = tuple(part for part in overlap.parts if part in self.parts)
            if len(parts) >= MIN_PARTS:
                yield "overlaps", self.composed(replace(overlap, parts=parts))


class Mirroring(Causes):
    """The method that declares mirror images of parts."""

    @overload
    def mirrored(self, part: Part, /, *, plane: Plane, names: Sequence[str], at: float = 0.0) -> Part: ...
    @overload
    def mirrored(self, *parts: Part, plane: Plane, names: Sequence[str], at: float = 0.0) -> tuple[Part, ...]: ...
    def mirrored(self, *parts: Part, plane: Plane, names: Sequence[str], at: float = 0.0) -> Part | tuple[Part, ...]:
        """Declare the mirror images of parts, and return them: a part for one, a tuple for several.

        plane   axis of the nominal assembly that is normal to the mirror plane: "x", "y" or "z"
        names   a text in names of parts, pairs and forces, and the text in its place: ("left", "right") makes "right door" of
                "left door". A name without the first text gets the second one at its end
        at      coordinate of the plane on this axis [mm], by default 0

        `right = model.mirrored(left, plane="y", names=("left", "right"))`

        Features, datums, tolerances, forms and elasticity of the parts come with them, and so do their locators on the ground,
        on a part, or on a feature that is mirrored, too; forces on them; contact pairs and meant overlaps between them. Contact
        with other parts, measures, joints, and causes of deviations do not, and neither does what is declared later.
        Coordinates, directions and faces in the frame of an image are the same as in the frame of its part; the mirror makes
        this frame left-handed. Images have draws of their own; equal deviations give mirrored parts.
        Raises ValueError or TypeError for wrong arguments.
        """
        mirror = _mirror_plane(self.assembly, parts, plane, names, at)
        images = tuple(self._add("parts", mirror.add_part(part)) for part in parts)
        for part, image in zip(parts, images, strict=True):
            image._elastics.extend(map(mirror.composed, part._elastics))
            for declared in part._declared:
                mirrored = image.add(mirror.composed(declared))
                if isinstance(declared, Feature | Pattern):
                    mirror.features.update(zip(declared.members, mirrored.members, strict=True))
        for name, thing in list(mirror.settings(self.assembly._declared)):
            self._add(name, thing)
        return images[0] if len(images) == 1 else images


def _mirror_plane(assembly: Any, parts: Sequence[Part], plane: Plane, names: Sequence[str], at: float) -> MirrorPlane:
    """Return the mirror plane for parts. Raises ValueError or TypeError for wrong arguments."""
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
    return MirrorPlane(plane, float(at), names, script_line(), {}, {})
