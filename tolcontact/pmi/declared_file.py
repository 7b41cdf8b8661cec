"""The PMI of a whole file, declared on each of its bodies that has toleranced faces."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tolcontact.declaration import Assembly, Mesh, Part
from tolcontact.geometry.files import STATED_FACES
from tolcontact.geometry.shapes import shape
from tolcontact.geometry.step_listing import LISTING_CHORD, bodies_in, part_name
from tolcontact.pmi.annotations import Pmi
from tolcontact.pmi.claims import Claim, missing_faces
from tolcontact.pmi.declared import Annotation, DeclaredAnnotation, DeclaredPmi
from tolcontact.pmi.declaring import declare_features
from tolcontact.readable import Readable


@dataclass(frozen=True, repr=False)
class DeclaredFile(Readable):
    """The PMI of a file as features of `parts`, one for each body with toleranced faces, and what became of each annotation."""

    pmi: Pmi
    parts: tuple[Part, ...]
    annotations: tuple[DeclaredAnnotation, ...]

    def __str__(self) -> str:
        return str(DeclaredPmi(tuple(feature for part in self.parts for feature in part.toleranced), self.annotations))


def declared_file(path: Path, pmi: Pmi) -> DeclaredFile:
    """Declare the PMI of a file on its bodies, as far as features can state it. Raises OptionError if it has no shapes.

    A body that stands at several places is declared once.
    """
    model = Assembly(path.stem)
    annotations: tuple[Annotation, ...] = (*pmi.tolerances, *pmi.dimensions, *pmi.datums)
    stated = {record for annotation in annotations for record in annotation.face_records}
    bodies = bodies_in(path)
    parts, claims, known = list[Part](), list[list[Claim]](), set[frozenset[int]]()
    for body in bodies:
        geometry = Mesh(path, body=body.number if len(bodies) > 1 else None, chord=LISTING_CHORD)
        read = shape(geometry)
        records = frozenset(record for face in read.mesh.metadata[STATED_FACES] for record in face.records) & stated
        if records and records not in known:
            known.add(records)
            part = model.part(part_name(body), geometry, at=body.at, rotation=body.rotation)
            claims.append(declare_features(part, pmi, read)[1])
            parts.append(part)
    merged = [_merged(parts, own) for own in zip(*claims, strict=True)]
    return DeclaredFile(pmi, tuple(parts), tuple(merged))


def _merged(parts: Sequence[Part], claims: Sequence[Claim]) -> DeclaredAnnotation:
    """Return what became of an annotation on all parts together."""
    placed = [(part, claim) for part, claim in zip(parts, claims, strict=True) if claim.numbers] or [(parts[0], claims[0])]
    names, reasons = list[str](), list[str]()
    for part, claim in placed:
        names += [f"{part.name}.{name}" if len(parts) > 1 else name for name in claim.features]
        reasons += [f"{part.name}: {reason}" if len(placed) > 1 else reason for reason in claim.reasons]
    claim = claims[0]
    missing = claim.stated - sum(len(own.numbers) for _, own in placed)
    reasons += [missing_faces(missing, claim.stated)] if 0 < missing < claim.stated else []
    return DeclaredAnnotation(claim.annotation, tuple(dict.fromkeys(names)), "; ".join(dict.fromkeys(reasons)))
