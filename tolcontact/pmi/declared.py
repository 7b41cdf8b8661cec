"""The PMI of a file, declared as features of one part, or of a part for each of its bodies that has toleranced faces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tolcontact.declaration import Assembly, Mesh, Part
from tolcontact.declaration.values import script_line
from tolcontact.errors import GeometryFault, OptionError
from tolcontact.features.datum_frames import Declared
from tolcontact.geometry.brep_face import describe_faces
from tolcontact.geometry.listing import LISTING_CHORD, FacesOfRecords, bodies_in, faces_of_records, part_name
from tolcontact.geometry.shapes import shape
from tolcontact.pmi.annotations import Datum, Dimension, Pmi, Tolerance
from tolcontact.pmi.claims import NO_FACE, Annotation, Claim, DeclaredAnnotation, missing_faces
from tolcontact.pmi.drafts import declare_features
from tolcontact.pmi.reading import read_pmi
from tolcontact.readable import Readable
from tolcontact.texts import shown


@dataclass(frozen=True, repr=False)
class DeclaredPmi(Readable):
    """The features, patterns and datum targets declared from the PMI of a file, and the outcome of each annotation."""

    features: tuple[Declared, ...]
    annotations: tuple[DeclaredAnnotation, ...]

    @property
    def undeclared(self) -> tuple[DeclaredAnnotation, ...]:
        """The annotations that are not declared, or only in part, with the reasons."""
        return tuple(annotation for annotation in self.annotations if annotation.reason)

    def __str__(self) -> str:
        counts = [
            f"{sum(not entry.reason for entry in entries)} of {len(entries)} {plural}"
            for kind, plural in ((Tolerance, "tolerances"), (Dimension, "dimensions"), (Datum, "datums"))
            if (entries := [entry for entry in self.annotations if isinstance(entry.annotation, kind)])
        ]
        title = f"{len(self.features)} features, patterns and datum targets, which state {', '.join(counts)}"
        return "\n".join([title, *(f"  {entry}" for entry in self.annotations if entry.reason or entry.remark)])


@dataclass(frozen=True, repr=False)
class DeclaredFile(DeclaredPmi):
    """The PMI of a file as features of `parts`, one for each body with toleranced faces, and the outcome of each annotation.

    faces    the faces of the file by their records
    faults   sentences on bodies whose shapes cannot be used
    """

    pmi: Pmi
    parts: tuple[Part, ...]
    faces: FacesOfRecords
    faults: tuple[str, ...] = ()

    @property
    def assembly(self) -> Assembly:
        """An assembly of the parts, which nothing locates or measures yet."""
        return Assembly("drawings").replaced(parts=self.parts)

    def __str__(self) -> str:
        return "\n".join([super().__str__(), *(f"  {fault}" for fault in self.faults)])


def features_from_pmi(part: Part) -> DeclaredPmi:
    """Declare the features of a part that the PMI of its STEP file states, and return them with all that is not declared.

    `print(tc.io.features_from_pmi(model.part("cover", tc.Mesh("cover.stp"))))`

    The part has to come from a STEP file of AP242. Faces of one surface are one feature, and so are the two planes of a slot or
    a tab whose size or position is toleranced. A feature is named after the letter of its datum, else after its kind and the
    number of its first face, as in "cylinder 12". Features that the part has already stay as they are.
    Raises OptionError if the file cannot be read, or states no PMI.
    """
    geometry = part.geometry
    name = f'part "{shown(part.name)}"'
    if not (isinstance(geometry, Mesh) and geometry.is_step):
        raise OptionError(f"{name} is a {geometry}; only a STEP file of AP242 states PMI")
    try:
        pmi = read_pmi(geometry.source)
        read = shape(geometry)
    except (OptionError, GeometryFault) as error:
        raise OptionError(f"{name}: {error}") from error
    if pmi.is_empty:
        raise OptionError(f"{name}: its file states no tolerances, dimensions or datums as AP242 does")
    features, claims = declare_features(part, pmi, read, script_line())
    return DeclaredPmi(features, tuple(claim.result for claim in claims))


def declared_file(path: Path, pmi: Pmi) -> DeclaredFile:
    """Declare the PMI of a file on its bodies, where features can state it.

    A body with several occurrences is declared once. Raises OptionError if the file has no shapes that can be used.
    """
    model = Assembly(path.stem)
    bodies, faces = bodies_in(path), faces_of_records(path)
    annotations: tuple[Annotation, ...] = (*pmi.datums, *pmi.dimensions, *pmi.tolerances)
    annotated = {record for annotation in annotations for record in annotation.face_records}
    annotated |= {record for dimension in pmi.dimensions for record in dimension.end_face_records}
    parts, features, claims = list[Part](), list[Declared](), list[list[Claim]]()
    earlier, faults = set[frozenset[int]](), list[str]()
    for body in bodies:
        records = frozenset(record for record, face in faces.items() if body.number in face.bodies and record in annotated)
        if not records or records in earlier:
            continue
        earlier.add(records)
        geometry = Mesh(path, body=body.number if len(bodies) > 1 else None, chord=LISTING_CHORD)
        try:
            read = shape(geometry)
        except GeometryFault as fault:
            faults.append(f"body {body.number}: {fault}")
            continue
        parts.append(model.part(part_name(body), geometry, at=body.at, rotation=body.rotation))
        declared, of_part = declare_features(parts[-1], pmi, read)
        features += declared
        claims.append(of_part)
        kinds = {face.number: face.kind for face in describe_faces(read)}
        faces |= {record: replace(faces[record], kind=kinds[faces[record].number]) for record in records}
    if faults and not parts:
        raise OptionError("; ".join(faults))
    if parts:
        results = [_merged(parts, of_parts) for of_parts in zip(*claims, strict=True)]
    else:  # the annotation is on edges and curves, or on no body
        reason = "none of its faces is on a body"
        results = [DeclaredAnnotation(stated, (), reason if stated.face_records else NO_FACE) for stated in annotations]
    return DeclaredFile(tuple(features), tuple(results), pmi, tuple(parts), faces, tuple(faults))


def _merged(parts: Sequence[Part], claims: Sequence[Claim]) -> DeclaredAnnotation:
    """Return the outcome of an annotation on all parts together, from its claims on each of them."""
    placed = [(part, claim) for part, claim in zip(parts, claims, strict=True) if claim.numbers] or [(parts[0], claims[0])]
    names, reasons = list[str](), list[str]()
    for part, claim in placed:
        names += [f"{part.name}.{name}" if len(parts) > 1 else name for name in claim.names]
        reasons += [f"{part.name}: {reason}" if len(placed) > 1 else reason for reason in claim.reasons]
    stated = claims[0].stated
    missing = stated - sum(len(claim.numbers) for _, claim in placed)
    reasons += [missing_faces(missing, stated)] if 0 < missing < stated else []
    return DeclaredAnnotation(claims[0].annotation, tuple(dict.fromkeys(names)), "; ".join(dict.fromkeys(reasons)))
