"""The description of a face of a body. Lengths in mm."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from tolcontact.declaration.selection import FACE_GROUPS
from tolcontact.declaration.values import Vector
from tolcontact.readable import Readable
from tolcontact.texts import shown_name

GENERAL = "general"  # kind of a face without an analytic surface


@dataclass(frozen=True, repr=False)
class FaceInFile(Readable):
    """A face of a body, in the body's own frame.

    number      from 1 in the file's order, for `tc.select.Brep`
    kind        plane, cylinder, cone, sphere, torus, or "general"
    point       a point on the face [mm]
    direction   outward normal of a plane; axis of a cylinder, cone or torus; otherwise None
    radius      [mm] of a cylinder or sphere, or of the circle inside a torus; otherwise None
    is_inner    whether a round face is hollow: its outside is towards its axis or centre
    centre      the projection of `point` on its axis, or the centre of a sphere or torus [mm]; otherwise None
    area        [mm2]; of its triangles, if the file contains only triangles
    residual    [mm] largest distance of its vertices from a fitted surface; 0 if the file states the surface
    name        its name in the file, not necessarily unique; empty if it has none
    whole       face numbers of its whole surface, including its own; empty if it is the only face
    slot        face numbers of its slot; empty if there is none
    pattern     face numbers of its pattern of equal holes; empty if there is none
    copies      number of other faces in the same position, which have no numbers of their own
    """

    number: int
    kind: str
    point: Vector
    direction: Vector | None
    radius: float | None
    is_inner: bool
    area: float
    centre: Vector | None = None
    residual: float = 0.0
    name: str = ""
    whole: tuple[int, ...] = ()
    slot: tuple[int, ...] = ()
    pattern: tuple[int, ...] = ()
    copies: int = 0

    def __str__(self) -> str:
        name = f'"{shown_name(self.name)}", ' if self.name else ""
        entries = [f"{self.number}. {name}{'inner ' if self.is_inner else ''}{self.kind}"]
        if self.radius is not None:
            entries.append(f"radius {self.radius:.6g} mm")
        if self.centre is not None:
            entries.append(f"{'centre' if self.kind == 'sphere' else 'axis through'} {_numbers(self.centre)}")
        if self.direction is not None:
            entries.append(f"along {_numbers(self.direction)}")
        if self.residual:
            entries.append(f"fitted within {self.residual:.1g} mm")
        if self.whole:
            neighbours = ", ".join(str(number) for number in self.whole if number != self.number)
            entries.append(f"one surface with {neighbours}")
        if self.copies:
            entries.append(f"occurs {self.copies + 1} times in the file")
        return ", ".join([*entries, f"{self.area:.4g} mm2", "at ({:.4g}, {:.4g}, {:.4g})".format(*self.point)])


def _numbers(vector: Vector) -> str:
    return "({:.7g}, {:.7g}, {:.7g})".format(*(round(c, 6) + 0.0 for c in vector))


def group_lines(faces: Sequence[FaceInFile]) -> Iterator[str]:
    """Yield a line for each slot and each hole pattern among the faces of a part, with the code that selects it."""
    for word in FACE_GROUPS:
        for group in dict.fromkeys(getattr(face, word) for face in faces):
            if group:
                yield f'{_title(word, group, faces)}: tc.select.Brep({group[0]}, whole="{word}")'


def _title(word: str, group: tuple[int, ...], faces: Sequence[FaceInFile]) -> str:
    members = [faces[number - 1] for number in group]
    radius = next(face.radius for face in members if face.radius is not None)
    if word == "slot":
        return f"slot, radius {radius:.6g} mm, faces {', '.join(map(str, group))}"
    holes = list(dict.fromkeys(face.whole or (face.number,) for face in members))
    listed = "; ".join(" and ".join(map(str, hole)) for hole in holes)
    return f"pattern of {len(holes)} holes, radius {radius:.6g} mm, faces {listed}"
