"""tolcontact pmi."""

import csv
import io
import json
import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict
from typing import Annotated

import typer
from rich import box
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from tolcontact.cli.app import AsJson, StepFile, app, examples, only_one
from tolcontact.cli.output import console
from tolcontact.errors import clipped, shown
from tolcontact.geometry.step_listing import RecordedFace, faces_of_records
from tolcontact.pmi import Datum, Dimension, Pmi, Tolerance, read_pmi
from tolcontact.pmi.second_reading import SecondReading, second_reading

WIDTH = 80  # of files and pipes
MAX_ROWS = 2000  # of a table, which takes a second; a drawing has a hundred
_CSV = (
    "type", "number", "record", "kind", "name", "value", "lower", "upper", "unit", "zone", "details", "datums", "refines",
    "face_records", "other_records", "end_face_records", "end_other_records", "faces", "end_faces",
)  # fmt: skip
_TOLERANCES = ("", "kind", "value", "zone, modifiers", "datums", "faces")
_DIMENSIONS = ("", "kind", "name", "nominal", "limits", "details", "faces")
_DATUMS = ("", "faces", "targets")
MAX_FACES = 12  # in a cell

AsCsv = Annotated[bool, typer.Option("--csv", help="Print the tolerances and dimensions as CSV.")]
WithFaces = Annotated[
    bool,
    typer.Option(
        "--faces", help="Give the numbers of faces as tolcontact faces does, and compare with the CAD kernel's own reading."
    ),
]
FacesOfRecords = Mapping[int, RecordedFace]


@app.command(epilog=examples("pmi part.stp --faces", "pmi part.stp --csv > part.csv"))
def pmi(file: StepFile, as_json: AsJson = False, as_csv: AsCsv = False, with_faces: WithFaces = False) -> None:
    """List the geometric tolerances, dimensions and datums that a STEP file of AP242 states. Lengths in mm, angles in rad."""
    only_one(json=as_json, csv=as_csv)
    information = read_pmi(file)
    faces = faces_of_records(file) if with_faces else {}
    if with_faces and not faces and not information.is_empty:
        typer.echo("warning: the faces have no numbers here: their records cannot be told, or the file has none", err=True)
    reading = second_reading(information, file, faces) if with_faces and not (as_csv or information.is_empty) else None
    if as_json:
        listed = {"faces": {record: asdict(face) for record, face in faces.items()}} if with_faces else {}
        compared = {"second_reading": asdict(reading)} if reading else {}
        typer.echo(json.dumps(asdict(information) | listed | compared, allow_nan=False))
    elif as_csv:
        typer.echo(_csv(information, faces), nl=False)
    elif information.is_empty:
        typer.echo(_reason(information, shown(str(file))))
    else:
        _print_tables(information, faces, reading)


def _reason(information: Pmi, name: str) -> str:
    """Return a sentence on a file that states nothing, with the reason if it is known."""
    if not information.is_ap242:
        schema = clipped(information.schema, 100) or "not stated"
        return f'"{name}" is no file of AP242 (its schema is {schema}); tolerances and dimensions are read from AP242 only'
    details = ""
    if information.drawings:
        details += f"; its {information.drawings} annotations are only drawn, and drawings are not read"
    if information.is_tessellated:
        details += "; its shapes are triangles, without faces to which tolerances could apply"
    return f'"{name}" states no tolerances, dimensions or datums{details}'


def _print_tables(information: Pmi, faces: FacesOfRecords, reading: SecondReading | None) -> None:
    output = console()
    width = output.width if sys.stdout.isatty() else WIDTH
    output.print(Text(str(information), style="bold"))
    for part in (*_sections(information, faces), *([] if reading is None else _reading_lines(reading))):
        output.print(part, width=width)


def _sections(information: Pmi, faces: FacesOfRecords) -> Iterator[RenderableType]:
    """Yield the tables with their titles. Tables without rows are left out."""
    tolerances = [_tolerance_row(tolerance, faces) for tolerance in information.tolerances[:MAX_ROWS]]
    dimensions = [_dimension_row(dimension, faces) for dimension in information.dimensions[:MAX_ROWS]]
    datums = [_datum_row(datum, faces) for datum in information.datums[:MAX_ROWS]]
    for title, columns, rows, count in (
        ("tolerances [mm]", _TOLERANCES, tolerances, len(information.tolerances)),
        ("dimensions [mm]", _DIMENSIONS, dimensions, len(information.dimensions)),
        ("datums", _DATUMS, datums, len(information.datums)),
    ):
        if rows:
            yield Text(f"\n{title}", style="bold")
            yield _table(columns, rows)
        if count > len(rows):
            yield Text(f"and {count - len(rows)} more, which --json lists")
    listed = [(row.face_records, row.other_records) for row in information.tolerances]
    listed += [(row.face_records, row.other_records) for row in information.dimensions]
    listed += [(row.face_records, row.other_records) for row in information.datums]
    if any(items and not records for records, items in listed):
        yield Text("\nin parentheses: edges, curves and points, where the file states no faces")
    bare = sum(not tolerance.face_records for tolerance in information.tolerances)
    if bare:
        yield Text(f"tolerances for which the file states no face: {bare}")
    if information.is_tessellated:
        yield Text("the shapes of the file are triangles, without faces")


def _reading_lines(reading: SecondReading) -> Iterator[RenderableType]:
    """Yield the sentences on the kernel's reading, and the differences."""
    yield Text("\nsecond reading, by the CAD kernel", style="bold")
    yield Text(str(reading))
    yield from map(Text, map(str, reading.differences[:MAX_ROWS]))
    if len(reading.differences) > MAX_ROWS:
        yield Text(f"and {len(reading.differences) - MAX_ROWS} more differences, which --json lists")


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table whose cells are wrapped, and never cut."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
    for column in columns:
        is_figure = column in ("value", "nominal")
        is_short = column in ("", "value", "nominal", "limits")
        table.add_column(column, justify="right" if is_figure else "left", no_wrap=is_short, overflow="fold")
    for row in rows:
        table.add_row(*map(Text, row))
    return table


def _tolerance_row(tolerance: Tolerance, faces: FacesOfRecords) -> tuple[str, ...]:
    return (
        str(tolerance.number), tolerance.kind or "not stated", _figure(tolerance.value), tolerance.details,
        tolerance.datum_system, _faces(tolerance.face_records, tolerance.other_records, faces),
    )  # fmt: skip


def _dimension_row(dimension: Dimension, faces: FacesOfRecords) -> tuple[str, ...]:
    places = _faces(dimension.face_records, dimension.other_records, faces)
    if dimension.end_face_records or dimension.end_other_records:
        places += f"{';' if faces else ','} {_faces(dimension.end_face_records, dimension.end_other_records, faces)}"
    limits = f"{_figure(dimension.lower)} to {_figure(dimension.upper)}".strip()
    unit = "" if dimension.unit in ("mm", "") else f" {dimension.unit}"
    return (
        str(dimension.number), dimension.kind, shown(dimension.name), f"{_figure(dimension.nominal)}{unit}",
        "" if limits == "to" else limits, dimension.details, places,
    )  # fmt: skip


def _datum_row(datum: Datum, faces: FacesOfRecords) -> tuple[str, ...]:
    targets = ", ".join(map(str, datum.targets))
    return shown(datum.letter), _faces(datum.face_records, datum.other_records, faces), targets


def _faces(records: Sequence[int], others: Sequence[int], faces: FacesOfRecords) -> str:
    """Return the faces if they are known, else how many there are; if there are none, how many other items, in parentheses."""
    if faces and records:
        known = [str(faces[record]) for record in records if record in faces][:MAX_FACES]
        more = len(records) - len(known)
        return ", ".join([*known, *([f"and {more} more"] if more else [])])
    return str(len(records)) if records or not others else f"({len(others)})"


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _csv(information: Pmi, faces: FacesOfRecords) -> str:
    text = io.StringIO()
    rows = csv.writer(text, lineterminator="\n")
    rows.writerow(_CSV)
    for tolerance in information.tolerances:
        rows.writerow((
            "tolerance", tolerance.number, tolerance.record, tolerance.kind, shown(tolerance.name), tolerance.value, None, None,
            "mm", shown(tolerance.zone), tolerance.details, tolerance.datum_system, tolerance.refines,
            _numbers(tolerance.face_records), _numbers(tolerance.other_records), None, None,
            _named(tolerance.face_records, faces), None,
        ))  # fmt: skip
    for dimension in information.dimensions:
        rows.writerow((
            "dimension", dimension.number, dimension.record, dimension.kind, shown(dimension.name), dimension.nominal,
            dimension.lower, dimension.upper, dimension.unit, None, dimension.details, None, None,
            _numbers(dimension.face_records), _numbers(dimension.other_records), _numbers(dimension.end_face_records),
            _numbers(dimension.end_other_records), _named(dimension.face_records, faces),
            _named(dimension.end_face_records, faces),
        ))  # fmt: skip
    return text.getvalue()


def _named(records: Sequence[int], faces: FacesOfRecords) -> str:
    return "; ".join(str(faces[record]) for record in records if record in faces)


def _numbers(records: Sequence[int]) -> str:
    return " ".join(map(str, records))
