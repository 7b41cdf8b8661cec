"""Variables of an archive that describe surfaces which are known exactly, and contact points of round faces."""

from tolcontact.vocabulary.labels import AXIS, FACE
from tolcontact.vocabulary.variable import ArchiveVariable

BREP_FACE, ROUND_POINT = "brep_face", "round_point"
SURFACE_KINDS = ("plane", "cylinder", "cone", "sphere", "torus")  # in the order of their numbers
KINDS_MEAN = {"flag_values": list(range(len(SURFACE_KINDS))), "flag_meanings": " ".join(SURFACE_KINDS)}


def _surface_variables(prefix: str, dim: str, surface: str) -> dict[str, ArchiveVariable]:
    """Return the variables of a surface, by the names of the attributes that they hold."""
    return {
        "kind": ArchiveVariable(f"{prefix}_kind", (dim,), "i1", f"kind of {surface}; -1: not known", "1", KINDS_MEAN),
        "origin": ArchiveVariable(
            f"{prefix}_point",
            (dim, AXIS),
            "f8",
            f"a point of {surface}, if it is a plane, or its centre; of a cone the apex",
            "mm",
        ),
        "axis": ArchiveVariable(
            f"{prefix}_axis", (dim, AXIS), "f8", f"unit normal or axis of {surface}; of a cone from the apex inward", "1"
        ),
        "radius": ArchiveVariable(
            f"{prefix}_radius", (dim,), "f8", f"radius of {surface}; of a torus that of the tube's middle", "mm"
        ),
        "minor": ArchiveVariable(f"{prefix}_tube_radius", (dim,), "f8", f"radius of the tube, if {surface} is a torus", "mm"),
        "angle": ArchiveVariable(f"{prefix}_angle", (dim,), "f8", f"angle between axis and {surface}, if it is a cone", "rad"),
    }


BREP_OF_FACE = ArchiveVariable("brep_of_face", (FACE,), "i4", "number of the B-rep face of each triangle, counted from 0")
OF_BREP_FACE = _surface_variables("surface", BREP_FACE, "the surface of a B-rep face, as the file stated it")
NAME_OF_BREP_FACE = ArchiveVariable(
    "surface_name", (BREP_FACE,), str, "what the file calls a B-rep face; empty: it has no name"
)

POINT_OF_ROUND = ArchiveVariable(
    "point_of_round", (ROUND_POINT,), "i4", "number of the contact point that is one of round faces, counted from 0"
)
OF_WALL = _surface_variables("wall", ROUND_POINT, "the wall that a ball or shaft may touch, nominal")
OF_ROUND = {
    "is_hollow": ArchiveVariable("wall_is_hollow", (ROUND_POINT,), "i1", "1 if the wall is around the ball or shaft", "1"),
    "towards": ArchiveVariable(
        "wall_middle", (ROUND_POINT, AXIS), "f8", "unit vector from a hollow wall's axis to its middle", "1"
    ),
    "opening": ArchiveVariable(
        "wall_opening", (ROUND_POINT,), "f8", "angle that a hollow wall reaches to either side; pi: whole", "rad"
    ),
    "cut": ArchiveVariable(
        "wall_end", (ROUND_POINT, AXIS), "f8", "unit normal of the plane in which the wall ends; 0: the shaft itself ends", "1"
    ),
    "centre": ArchiveVariable(
        "round_centre", (ROUND_POINT, AXIS), "f8", "centre of the ball, or of the shaft's end, nominal", "mm"
    ),
    "axis": ArchiveVariable(
        "round_axis", (ROUND_POINT, AXIS), "f8", "unit vector of the shaft's axis, nominal; 0 of a ball", "1"
    ),
    "radius": ArchiveVariable("round_radius", (ROUND_POINT,), "f8", "radius of the ball or shaft", "mm"),
    "on_moving": ArchiveVariable(
        "round_on_moving", (ROUND_POINT,), "i1", "1 if ball or shaft belong to the moving part, 0 if the wall does", "1"
    ),
}
ROUND = (POINT_OF_ROUND, *OF_WALL.values(), *OF_ROUND.values())
KNOWN_SURFACES = (BREP_OF_FACE, *OF_BREP_FACE.values())
