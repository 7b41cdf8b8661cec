"""Compare the product and manufacturing information that `tc.io.read_pmi` returns with what the CAD kernel reads.

The kernel reads less than the file states. Annotations of the same record are compared.
"""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.kernel_annotations import (
    KernelAnnotations,
    KernelDimension,
    KernelItems,
    KernelTolerance,
    kernel_annotations,
)
from tolcontact.errors import GeometryFault
from tolcontact.pmi import Dimension, Pmi, Tolerance
from tolcontact.readable import Readable
from tolcontact.texts import shown

PRECISION = 1e-9  # relative, of values that agree; units may be converted in another order
ZERO = 1e-12  # [mm, rad], of limits that agree in 0
_DIAMETERS = ("cylindrical or circular", "within a cylinder", "within a circle")
_SPHERES = ("spherical", "within a sphere")
_WITH_VALUES = (
    "circular or cylindrical",
    "distance",
    "projected",
    "spherical",
)  # modifiers of datums that the kernel does not tell


@dataclass(frozen=True, repr=False)
class Difference(Readable):
    """A difference between a file's annotation as it is listed, and as the kernel reads it.

    annotation, number   "tolerance" or "dimension", with its number
    attribute            that differs: "value", "zone", "faces", ...
    listed, kernel       both readings in words; of faces, those that only one of them has
    """

    annotation: str
    number: int
    attribute: str
    listed: str
    kernel: str

    def __str__(self) -> str:
        return shown(
            f"{self.annotation} {self.number}: {self.attribute} {self.listed or 'none'}, kernel {self.kernel or 'none'}"
        )


@dataclass(frozen=True, repr=False)
class SecondReading(Readable):
    """The kernel's reading of a file beside the listed one.

    fault                     a sentence if the kernel could not read the annotations; everything else is empty then
    tolerances, dimensions    number of annotations that the kernel reads
    unread_tolerances, ...    numbers of the listed annotations that it does not read
    unlisted                  annotations that only the kernel has, by their records
    """

    fault: str = ""
    tolerances: int = 0
    dimensions: int = 0
    differences: tuple[Difference, ...] = ()
    unread_tolerances: tuple[int, ...] = ()
    unread_dimensions: tuple[int, ...] = ()
    unlisted: tuple[str, ...] = ()

    def __str__(self) -> str:
        return self.fault or "\n".join(self.sentences())

    def sentences(self) -> Iterator[str]:
        """Yield what the kernel reads, in how much of it the readings differ, and what only one of them has."""
        count = len({(difference.annotation, difference.number) for difference in self.differences})
        yield f"the kernel reads {self.tolerances} tolerances and {self.dimensions} dimensions; {count} of them differ"
        for annotation, numbers in (("tolerances", self.unread_tolerances), ("dimensions", self.unread_dimensions)):
            if numbers:
                yield f"the kernel does not read {annotation} {', '.join(map(str, numbers))}"
        for title in self.unlisted:
            yield f"only the kernel has {title}"


def second_reading(pmi: Pmi, path: str | Path, faces: Mapping[int, object]) -> SecondReading:
    """Compare the annotations of a file with those that the CAD kernel reads from it.

    Faces in `faces` are called by their numbers, others by their records. A kernel that crashes is a fault of the result.
    """
    try:
        return compare(pmi, kernel_annotations(path), faces)
    except GeometryFault as fault:
        return SecondReading(fault=str(fault))


def compare(pmi: Pmi, kernel: KernelAnnotations, faces: Mapping[int, object]) -> SecondReading:
    """Compare the annotations of a file with those that the kernel read."""
    tolerances = {tolerance.record: tolerance for tolerance in kernel.tolerances}
    dimensions = {dimension.record: dimension for dimension in kernel.dimensions}
    differences: list[Difference] = []
    for tolerance in pmi.tolerances:
        if tolerance.record in tolerances:
            pairs = _tolerance_pairs(tolerance, tolerances[tolerance.record], faces)
            differences.extend(Difference("tolerance", tolerance.number, *pair) for pair in pairs)
    for dimension in pmi.dimensions:
        if dimension.record in dimensions:
            pairs = _dimension_pairs(dimension, dimensions[dimension.record], faces)
            differences.extend(Difference("dimension", dimension.number, *pair) for pair in pairs)
    listed = {tolerance.record for tolerance in pmi.tolerances} | {dimension.record for dimension in pmi.dimensions}
    unlisted = [
        f"a {entry.kind} of {entry.value:.6g} mm, #{entry.record}" for entry in kernel.tolerances if entry.record not in listed
    ]
    unlisted += [f"a dimension, #{entry.record}" for entry in kernel.dimensions if entry.record not in listed]
    return SecondReading(
        tolerances=len(tolerances),
        dimensions=len(dimensions),
        differences=tuple(differences),
        unread_tolerances=tuple(entry.number for entry in pmi.tolerances if entry.record not in tolerances),
        unread_dimensions=tuple(entry.number for entry in pmi.dimensions if entry.record not in dimensions),
        unlisted=tuple(unlisted),
    )


Pair = tuple[str, str, str]  # an attribute, and both readings of it


def _tolerance_pairs(tolerance: Tolerance, kernel: KernelTolerance, faces: Mapping[int, object]) -> Iterator[Pair]:
    """Yield the attributes in which a tolerance differs."""
    if tolerance.kind != kernel.kind:
        yield "kind", tolerance.kind, kernel.kind
    if not _is_close(tolerance.value, kernel.value):
        yield "value", _figure(tolerance.value), _figure(kernel.value)
    if _zone(tolerance.zone) != kernel.zone:
        yield "zone", tolerance.zone, kernel.zone
    if not _is_close(tolerance.projected, kernel.projected):
        yield "projected length", _figure(tolerance.projected), _figure(kernel.projected)
    if set(tolerance.modifiers) != kernel.modifiers:
        yield "modifiers", ", ".join(sorted(tolerance.modifiers)), ", ".join(sorted(kernel.modifiers))
    if tolerance.extent != kernel.extent:
        yield "extent", tolerance.extent, kernel.extent
    datums = tuple((reference.letters, _told(reference.modifiers)) for reference in tolerance.datums)
    if datums != kernel.datums:
        yield "datums", tolerance.datum_system, " | ".join(_reference(*reference) for reference in kernel.datums)
    yield from _face_pairs("faces", tolerance.face_records, kernel.items, faces)


def _dimension_pairs(dimension: Dimension, kernel: KernelDimension, faces: Mapping[int, object]) -> Iterator[Pair]:
    """Yield the attributes in which a dimension differs. The kernel has no nominal value beside limits."""
    if dimension.kind.startswith("angular") != kernel.is_angular:
        yield "kind", dimension.kind, "angle" if kernel.is_angular else "length"
    scale = math.radians(1) if dimension.unit == "rad" else 1.0
    if kernel.limits is None and not _is_close(dimension.nominal, _scaled(kernel.nominal, scale)):
        yield "nominal value", _figure(dimension.nominal), _figure(_scaled(kernel.nominal, scale))
    limits = _limits(dimension, kernel, scale)
    if not (_is_close(dimension.lower, limits[0]) and _is_close(dimension.upper, limits[1])):
        yield "limits", _range(dimension.lower, dimension.upper), _range(*limits)
    if bool(dimension.fit) != kernel.has_fit:
        yield "fit", dimension.fit, "stated" if kernel.has_fit else ""
    yield from _face_pairs("faces", dimension.face_records, kernel.items, faces)
    yield from _face_pairs("faces of the end", dimension.end_face_records, kernel.end_items, faces)


def _limits(dimension: Dimension, kernel: KernelDimension, scale: float) -> tuple[float | None, float | None]:
    """Return the kernel's limits. Its lower deviation has no sign, and gets that of the listed one."""
    if kernel.limits is not None:
        return scale * kernel.limits[0], scale * kernel.limits[1]
    if kernel.deviations is None or kernel.nominal is None:
        return None, None
    lower, upper = kernel.deviations
    is_above = None not in (dimension.lower, dimension.nominal) and (dimension.lower or 0.0) > (dimension.nominal or 0.0)
    return scale * (kernel.nominal + (lower if is_above else -lower)), scale * (kernel.nominal + upper)


def _face_pairs(attribute: str, records: Sequence[int], items: KernelItems, faces: Mapping[int, object]) -> Iterator[Pair]:
    """Yield the faces that only one reading has. Where the kernel has none, it may have edges in their place."""
    if set(records) != items.face_records:
        listed = [record for record in records if record not in items.face_records]
        kernel = sorted(items.face_records - set(records))
        others = f"{items.others} edges or points" if items.others and not items.face_records else ""
        yield attribute, _names(listed, faces), _names(kernel, faces) or others


def _names(records: Sequence[int], faces: Mapping[int, object]) -> str:
    return ", ".join(str(faces[record]) if record in faces else f"#{record}" for record in records)


def _zone(form: str) -> str:
    """Return the kernel's word for the form of a zone."""
    forms = form.split(", ")
    if any(word in _DIAMETERS for word in forms):
        return "diameter"
    return "spherical diameter" if any(word in _SPHERES for word in forms) else ""


def _told(modifiers: Sequence[str]) -> frozenset[str]:
    """Return the modifiers of a datum reference that the kernel tells."""
    return frozenset(modifier for modifier in modifiers if not modifier.startswith(_WITH_VALUES))


def _reference(letters: Sequence[str], modifiers: frozenset[str]) -> str:
    return "-".join(letters) + "".join(f" ({modifier})" for modifier in sorted(modifiers))


def _scaled(value: float | None, scale: float) -> float | None:
    return None if value is None else scale * value


def _is_close(listed: float | None, kernel: float | None) -> bool:
    if listed is None or kernel is None:
        return listed is kernel
    return math.isclose(listed, kernel, rel_tol=PRECISION, abs_tol=ZERO)


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.10g}"


def _range(lower: float | None, upper: float | None) -> str:
    return "" if lower is None and upper is None else f"{_figure(lower)} to {_figure(upper)}"
