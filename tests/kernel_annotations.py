"""Tolerances and dimensions of a STEP file as the CAD kernel reads them, to compare with `tc.io.read_pmi`. Lengths in mm.

The kernel reads less than the file states, and may crash, so it runs in a process of its own.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from tolcontact.child import ChildDiedError, run_child
from tolcontact.errors import GeometryFault
from tolcontact.geometry.files import screening
from tolcontact.geometry.files.reading import DEFAULT_LIMITS
from tolcontact.geometry.files.step_text import StepText

PROGRAM = Path(__file__).parent / "scripts" / "step_annotations.py"


@dataclass(frozen=True)
class KernelItems:
    """The shapes that an annotation applies to: record numbers of faces, and the count of other shapes."""

    face_records: frozenset[int]
    others: int


@dataclass(frozen=True)
class KernelTolerance:
    """A geometric tolerance with its record number. Terms are the same as in `tolcontact.pmi`.

    value, projected   [mm]; None without a projected zone
    zone               "diameter", "spherical diameter" or empty
    extent             "all around", "all over" or empty
    datums             letters and modifiers of each position in the datum system
    """

    record: int
    kind: str
    value: float
    zone: str
    projected: float | None
    modifiers: frozenset[str]
    extent: str
    datums: tuple[tuple[tuple[str, ...], frozenset[str]], ...]
    items: KernelItems


@dataclass(frozen=True)
class KernelDimension:
    """A dimension with its record number. Lengths are in mm, angles in degrees.

    nominal      None if there is none, or if the kernel keeps limits only
    limits       the lower and the upper limit
    deviations   the lower deviation without its sign, and the upper deviation
    """

    record: int
    is_angular: bool
    nominal: float | None
    limits: tuple[float, float] | None
    deviations: tuple[float, float] | None
    has_fit: bool
    items: KernelItems
    end_items: KernelItems


@dataclass(frozen=True)
class KernelAnnotations:
    """The tolerances and dimensions of a file."""

    tolerances: tuple[KernelTolerance, ...]
    dimensions: tuple[KernelDimension, ...]


def kernel_annotations(path: str | Path) -> KernelAnnotations:
    """Return the tolerances and dimensions that the CAD kernel reads from a STEP file.

    Raises GeometryFault if it crashes, stalls, or counts other records than the file has.
    """
    path = Path(path)
    screening.screen(path, DEFAULT_LIMITS.triangles)
    seconds = int(DEFAULT_LIMITS.seconds + DEFAULT_LIMITS.seconds_per_mb * path.stat().st_size / 1e6)
    try:
        output = run_child(PROGRAM, str(path.absolute()), memory=DEFAULT_LIMITS.memory, seconds=seconds)
    except ChildDiedError as error:
        raise GeometryFault(f"the kernel could not read the PMI: {error}") from error
    content = json.loads(output)
    numbers = StepText(path.read_bytes()).order
    if len(numbers) != content["record_count"]:
        raise GeometryFault(
            f"the kernel could not read the PMI: it counts {content['record_count']} records, and the file has {len(numbers)}"
        )
    return KernelAnnotations(
        tuple(_tolerance(entry, numbers) for entry in content["tolerances"]),
        tuple(_dimension(entry, numbers) for entry in content["dimensions"]),
    )


def _tolerance(entry: Mapping[str, Any], numbers: Sequence[int]) -> KernelTolerance:
    return KernelTolerance(
        record=numbers[entry["place"] - 1],
        **{name: entry[name] for name in ("kind", "value", "zone", "projected", "extent")},
        modifiers=frozenset(entry["modifiers"]),
        datums=tuple((tuple(letters), frozenset(modifiers)) for letters, modifiers in entry["datums"]),
        items=_items(entry["faces"], entry["others"], numbers),
    )


def _dimension(entry: Mapping[str, Any], numbers: Sequence[int]) -> KernelDimension:
    return KernelDimension(
        record=numbers[entry["place"] - 1],
        **{name: entry[name] for name in ("is_angular", "nominal", "has_fit")},
        limits=_pair(entry["limits"]),
        deviations=_pair(entry["deviations"]),
        items=_items(entry["faces"], entry["others"], numbers),
        end_items=_items(entry["end_faces"], entry["end_others"], numbers),
    )


def _items(places: Sequence[int], others: int, numbers: Sequence[int]) -> KernelItems:
    return KernelItems(frozenset(numbers[place - 1] for place in places), others)


def _pair(values: Sequence[float] | None) -> tuple[float, float] | None:
    return None if values is None else (values[0], values[1])
