"""Mirror images of parts: left and right doors. What is declared of the parts alone, and between them, is mirrored with them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Literal, overload

from scipy.spatial.transform import Rotation

from tolcontact.declaration.causes import Causes
from tolcontact.declaration.contact_pair import ContactPair, Force, Overlap
from tolcontact.declaration.declarations import expect
from tolcontact.declaration.elastic import Elastic
from tolcontact.declaration.locator import Location, Locator, ThreeTwoOne
from tolcontact.declaration.part import DatumTargets, Face, Feature, Part, Pattern, Point
from tolcontact.declaration.selection import Near
from tolcontact.declaration.values import Vector, is_length, script_line

Plane = Literal["x", "y", "z"]
PLANES: tuple[Plane, ...] = ("x", "y", "z")


@dataclass(frozen=True)
class Mirror:
    """A mirror plane of the nominal assembly, and the images that it has made.

    plane      axis that is normal to it
    at         [mm] its coordinate on this axis
    names      a text in names, and the text in its place in names of images
    parts      images of parts
    features   images of features, of members of patterns, too
    line       of the script
    """

    plane: Plane
    at: float
    names: tuple[str, str]
    parts: dict[Part, Part]
    features: dict[Feature, Feature]
    line: str

    def name(self, name: str) -> str:
        """Return the name of an image: with the text replaced, or added if the name lacks it."""
        old, new = self.names
        return name.replace(old, new) if old in name else f"{name} {new}"

    def vector(self, vector: Vector) -> Vector:
        """Return the image of a direction of the nominal assembly."""
        x, y, z = (-c + 0.0 if axis == self.plane else c for axis, c in zip(PLANES, vector, strict=True))
        return x, y, z

    def part(self, part: Part) -> Part:
        """Return the image of a part without its features: coordinates in its frame are the same, and the frame is mirrored."""
        x, y, z = (2 * self.at - c if axis == self.plane else c for axis, c in zip(PLANES, part.at, strict=True))
        rotation, mirror = tuple(0.0 - c for c in self.vector(part.rotation)), self.plane if not part.mirror else ""
        if part.mirror not in ("", self.plane):  # two mirrors are half a turn about the third axis
            half = [180.0 * (axis not in (part.mirror, self.plane)) for axis in PLANES]
            turned = Rotation.from_rotvec(rotation) * Rotation.from_euler("xyz", half, degrees=True)
            rotation = tuple(float(c) for c in turned.as_rotvec())
        image = replace(part, name=self.name(part.name), at=(x, y, z), rotation=rotation, mirror=mirror, declared_at=self.line)
        self.parts[part] = image
        return image

    def declare_features(self, part: Part) -> None:
        """Declare the features, datum targets and elasticity of the image of a part."""
        for declared in part._declared:
            self.parts[part].add(self.declared(declared))

    def declared(self, declared: Any) -> Any:
        """Return the image of a feature, a pattern, datum targets or an elasticity."""
        image: Any
        match declared:
            case Feature():
                image = replace(declared, part=self.parts[declared.part], faces=self.faces(declared.faces), declared_at=self.line)
                self.features[declared] = image
            case Pattern():
                members = tuple(
                    self.features[member] if isinstance(member, Feature) else self.faces(member)
                    for member in declared.constituents
                )
                image = replace(declared, part=self.parts[declared.part], constituents=members, declared_at=self.line)
                self.features.update(zip(declared.members, image.members, strict=True))
            case DatumTargets():
                image = replace(declared, points=tuple(map(self.point, declared.points)), declared_at=self.line)
            case Elastic():
                image = replace(declared, declared_at=self.line)
        return image

    def face(self, face: Face) -> Face:
        """Return the image of a face."""
        selections = tuple(
            replace(selection, part=self.parts.get(selection.part, selection.part)) if isinstance(selection, Near) else selection
            for selection in face.selections
        )
        return Face(self.parts[face.part], selections)

    def faces(self, faces: Sequence[Face]) -> tuple[Face, ...]:
        """Return the images of faces."""
        return tuple(map(self.face, faces))

    def point(self, point: Point) -> Point:
        """Return the image of a point."""
        return replace(point, part=self.parts[point.part], on=point.on and self.features[point.on])

    def location(self, location: Location) -> Location | None:
        """Return the image of the location of a part; None for a joint, and for a location on a feature without an image."""
        on: Any = location.on
        on = self.features.get(on) if isinstance(on, Feature) else self.parts.get(on, on)
        if location.joint or (on is None and location.on is not None):
            return None
        scheme: Any = location.scheme
        if isinstance(scheme, ThreeTwoOne):
            scheme = ThreeTwoOne(*self.faces(scheme.faces), scheme.inset)
        else:
            scheme = tuple(map(self.locator, scheme))
        return replace(location, part=self.parts[location.part], on=on, scheme=scheme, declared_at=self.line)

    def locator(self, locator: Locator) -> Locator:
        """Return the image of a locator of a part: in the frame of the part, its point and direction are the same."""
        return replace(locator, part=locator.part and self.parts[locator.part], on=locator.on and self.features[locator.on])

    def pair(self, pair: ContactPair) -> ContactPair:
        """Return the image of a contact pair."""
        moving, reference = self.face(pair.moving), self.face(pair.reference)
        return replace(pair, moving=moving, reference=reference, name=self.name(pair.name), declared_at=self.line)

    def force(self, force: Force) -> Force:
        """Return the image of a force."""
        name, vector = self.name(force.name), self.vector(force.vector)
        return replace(force, at=self.point(force.at), name=name, vector=vector, declared_at=self.line)


class Mirroring(Causes):
    """The method that declares mirror images of parts."""

    @overload
    def mirrored(self, part: Part, /, *, plane: Plane, names: tuple[str, str], at: float = 0.0) -> Part: ...
    @overload
    def mirrored(self, *parts: Part, plane: Plane, names: tuple[str, str], at: float = 0.0) -> tuple[Part, ...]: ...
    def mirrored(
        self, *parts: Part, plane: Plane, names: tuple[str, str], at: float = 0.0
    ) -> Part | tuple[Part, ...]:  # fmt: skip
        """Declare the mirror images of parts, and return them: a part for one, a tuple for several.

        plane   axis of the nominal assembly that is normal to the mirror plane: "x", "y" or "z"
        names   a text in names, and the text in its place: ("left", "right") makes "right door" of "left door". A name without
                the first text gets the second one at its end
        at      coordinate of the plane on this axis [mm], by default 0

        `right = model.mirrored(left, plane="y", names=("left", "right"))`

        Features, patterns, datums, tolerances, forms and elasticity of the parts come with them, and so do their locators, on
        the ground, on another part or on the image of a feature; forces on them; and contact pairs and meant overlaps between
        them. Coordinates, directions and faces in the frame of an image are the same as in the frame of its part, which the
        mirror turns into a left-handed frame. All deviations of an image are drawn independently, and equal deviations give
        mirrored parts. Contact with other parts, measures and joints are to be declared. Raises ValueError or TypeError for
        wrong arguments.
        """
        mirror = _mirror(self.assembly, parts, plane, names, at)
        images = tuple(self._add("parts", mirror.part(part)) for part in parts)
        for part in parts:
            mirror.declare_features(part)
        for name, thing in _images(mirror, self.assembly._declared):
            self._add(name, thing)
        return images[0] if len(images) == 1 else images


def _mirror(assembly: Any, parts: Sequence[Part], plane: Plane, names: tuple[str, str], at: float) -> Mirror:
    """Return a mirror for parts. Raises ValueError or TypeError for wrong arguments."""
    for part in parts:
        expect("mirrored: an argument", part, Part, "parts, as in mirrored(left, plane=..., names=...)")
        if parts.count(part) > 1 or part not in assembly.parts:
            fault = "is given twice; give it once" if parts.count(part) > 1 else f'is no part of "{assembly.name}"; take one of it'
            raise ValueError(f'mirrored: part "{part.name}" {fault}')
    if not parts:
        raise ValueError("mirrored: no part is given; expected one or more, as in mirrored(left, plane=..., names=...)")
    if plane not in PLANES:
        raise ValueError(f'mirrored: plane is {plane!r}; expected the axis that is normal to it, "x", "y" or "z"')
    if not is_length(at):
        raise ValueError(f"mirrored: at is {at!r}; expected a coordinate in mm")
    is_pair = isinstance(names, tuple | list) and len(names) == 2 and all(isinstance(text, str) and text for text in names)
    if not is_pair or names[0] == names[1]:
        raise ValueError(f'mirrored: names is {names!r}; expected two different texts, as in names=("left", "right")')
    return Mirror(plane, float(at), (names[0], names[1]), {}, {}, script_line())


def _images(mirror: Mirror, declared: Mapping[str, Sequence[Any]]) -> list[tuple[str, Any]]:
    """Return the images of locations, contact pairs, forces and overlaps of the mirrored parts, with the names of their lists."""
    parts = mirror.parts
    images: list[tuple[str, Any]] = [
        ("locations", mirror.location(location)) for location in declared["locations"] if location.part in parts
    ]
    for pair in declared["pairs"]:
        if pair.moving.part in parts and pair.reference.part in parts:
            images.append(("pairs", mirror.pair(pair)))
    images += [("forces", mirror.force(force)) for force in declared["forces"] if force.at.part in parts]
    for overlap in declared["overlaps"]:
        if all(part in parts for part in overlap.parts):
            images.append(("overlaps", Overlap(tuple(parts[part] for part in overlap.parts), mirror.line)))
    return [(name, image) for name, image in images if image is not None]
