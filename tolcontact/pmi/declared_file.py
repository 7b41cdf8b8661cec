"""The PMI of a whole file, declared on each of its bodies that has toleranced faces."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from tolcontact.declaration import Assembly, Mesh, Part
from tolcontact.errors import GeometryFault, OptionError
from tolcontact.geometry.brep_face import describe_faces
from tolcontact.geometry.shapes import shape
from tolcontact.geometry.step_listing import LISTING_CHORD, FacesOfRecords, bodies_in, faces_of_records, part_name
from tolcontact.pmi.annotations import Pmi
from tolcontact.pmi.claims import NO_FACE, Claim, missing_faces
from tolcontact.pmi.declared import Annotation, DeclaredAnnotation, DeclaredPmi
from tolcontact.pmi.declaring import declare_features
from tolcontact.readable import Readable


@dataclass(frozen=True, repr=False)
class DeclaredFile(Readable):
    """The PMI of a file as features of `parts`, one for each body with toleranced faces, and what became of each annotation.

    faces    the faces of the file by their records
    faults   sentences on bodies whose shapes cannot be used
    """

    pmi: Pmi
    parts: tuple[Part, ...]
    annotations: tuple[DeclaredAnnotation, ...]
    faces: FacesOfRecords
    faults: tuple[str, ...] = ()

    def __str__(self) -> str:
        features = tuple(declared for part in self.parts for declared in (*part.toleranced, *part.targets))
        return "\n".join([str(DeclaredPmi(features, self.annotations)), *(f"  {fault}" for fault in self.faults)])


def declared_file(path: Path, pmi: Pmi) -> DeclaredFile:
    """Declare the PMI of a file on its bodies, as far as features can state it.

    A body that stands at several places is declared once. Raises OptionError if the file has no shapes that can be used.
    """
    model = Assembly(path.stem)
    bodies, faces = bodies_in(path), faces_of_records(path)
    parts, claims, known, faults = list[Part](), list[list[Claim]](), set[frozenset[int]](), list[str]()
    for body in bodies:
        records = frozenset(record for record, face in faces.items() if body.number in face.bodies) & _records(pmi)
        if not records or records in known:
            continue
        known.add(records)
        geometry = Mesh(path, body=body.number if len(bodies) > 1 else None, chord=LISTING_CHORD)
        try:
            read = shape(geometry)
        except GeometryFault as fault:
            faults.append(f"body {body.number}: {fault}")
            continue
        part = model.part(part_name(body), geometry, at=body.at, rotation=body.rotation)
        claims.append(declare_features(part, pmi, read)[1])
        parts.append(part)
        kinds = {face.number: face.kind for face in describe_faces(read.mesh)}
        faces |= {record: replace(faces[record], kind=kinds[faces[record].number]) for record in records}
    if faults and not parts:
        raise OptionError("; ".join(faults))
    if not parts:  # what the file states is on edges and curves, or on no body
        reasons = (
            (annotation, "none of its faces is on a body" if annotation.face_records else NO_FACE) for annotation in _all(pmi)
        )
        return DeclaredFile(pmi, (), tuple(DeclaredAnnotation(annotation, (), reason) for annotation, reason in reasons), faces)
    merged = [_merged(parts, group) for group in zip(*claims, strict=True)]
    return DeclaredFile(pmi, tuple(parts), tuple(merged), faces, tuple(faults))


def _records(pmi: Pmi) -> frozenset[int]:
    """Return the records of all faces to which annotations apply."""
    ends = (record for dimension in pmi.dimensions for record in dimension.end_face_records)
    return frozenset((*(record for annotation in _all(pmi) for record in annotation.face_records), *ends))


def _all(pmi: Pmi) -> tuple[Annotation, ...]:
    return (*pmi.datums, *pmi.dimensions, *pmi.tolerances)


def _merged(parts: Sequence[Part], claims: Sequence[Claim]) -> DeclaredAnnotation:
    """Return what became of an annotation on all parts together."""
    placed = [(part, claim) for part, claim in zip(parts, claims, strict=True) if claim.numbers] or [(parts[0], claims[0])]
    names, reasons = list[str](), list[str]()
    for part, claim in placed:
        names += [f"{part.name}.{name}" if len(parts) > 1 else name for name in claim.features]
        reasons += [f"{part.name}: {reason}" if len(placed) > 1 else reason for reason in claim.reasons]
    claim = claims[0]
    missing = claim.stated - sum(len(placed_claim.numbers) for _, placed_claim in placed)
    reasons += [missing_faces(missing, claim.stated)] if 0 < missing < claim.stated else []
    return DeclaredAnnotation(claim.annotation, tuple(dict.fromkeys(names)), "; ".join(dict.fromkeys(reasons)))
