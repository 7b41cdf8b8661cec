"""The PMI of a whole file, declared on each of its bodies that has toleranced faces."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tolcontact.declaration import Assembly, Mesh, Part
from tolcontact.errors import GeometryFault, OptionError
from tolcontact.geometry.files import FACE_RECORDS
from tolcontact.geometry.shapes import shape
from tolcontact.geometry.step_listing import LISTING_CHORD, bodies_in, part_name
from tolcontact.pmi.annotations import Pmi
from tolcontact.pmi.claims import Claim, missing_faces
from tolcontact.pmi.declared import Annotation, DeclaredAnnotation, DeclaredPmi
from tolcontact.pmi.declaring import declare_features
from tolcontact.readable import Readable


@dataclass(frozen=True, repr=False)
class DeclaredFile(Readable):
    """The PMI of a file as features of `parts`, one for each body with toleranced faces, and what became of each annotation.

    faults   a sentence for each body whose shape cannot be used; annotations of its faces are not declared
    """

    pmi: Pmi
    parts: tuple[Part, ...]
    annotations: tuple[DeclaredAnnotation, ...]
    faults: tuple[str, ...] = ()

    def __str__(self) -> str:
        declared = DeclaredPmi(tuple(feature for part in self.parts for feature in part.toleranced), self.annotations)
        return "\n".join([str(declared), *(f"  {fault}" for fault in self.faults)])


def declared_file(path: Path, pmi: Pmi) -> DeclaredFile:
    """Declare the PMI of a file on its bodies, as far as features can state it.

    A body that stands at several places is declared once. Raises OptionError if the file has no shapes that can be used.
    """
    model = Assembly(path.stem)
    annotations: tuple[Annotation, ...] = (*pmi.tolerances, *pmi.dimensions, *pmi.datums)
    stated = {record for annotation in annotations for record in annotation.face_records}
    bodies = bodies_in(path)
    parts, claims, known, faults = list[Part](), list[list[Claim]](), set[frozenset[int]](), list[str]()
    for body in bodies:
        geometry = Mesh(path, body=body.number if len(bodies) > 1 else None, chord=LISTING_CHORD)
        try:
            read = shape(geometry)
        except GeometryFault as fault:
            faults.append(str(fault))
            continue
        records = frozenset(read.mesh.metadata[FACE_RECORDS]) & stated
        if records and records not in known:
            known.add(records)
            part = model.part(part_name(body), geometry, at=body.at, rotation=body.rotation)
            claims.append(declare_features(part, pmi, read)[1])
            parts.append(part)
    if faults and not parts:
        raise OptionError("; ".join(faults))
    merged = [_merged(parts, own) for own in zip(*claims, strict=True)]
    return DeclaredFile(pmi, tuple(parts), tuple(merged), tuple(faults))


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
