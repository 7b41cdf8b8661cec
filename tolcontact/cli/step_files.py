"""tolcontact pmi, tolcontact bodies, tolcontact faces."""

import csv
import io
import json
import re
import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import typer
from rich import box
from rich.console import RenderableType
from rich.table import Table
from rich.text import Text

from tolcontact.cli.app import AsJson, StepFile, app, echo, examples, flag, only_one
from tolcontact.cli.output import console
from tolcontact.cli.progress import waiting
from tolcontact.errors import OptionError
from tolcontact.geometry import bodies_in, faces_in, group_lines
from tolcontact.geometry.listing import FacesOfRecords
from tolcontact.pmi import Datum, Dimension, Pmi, Tolerance, read_pmi
from tolcontact.pmi.claims import Annotation
from tolcontact.pmi.declared import DeclaredFile, declared_file
from tolcontact.pmi.script import script
from tolcontact.report.table import FILE_WIDTH
from tolcontact.texts import clipped, csv_cell, shown, shown_name

MAX_ROWS = 2000  # of a table, which takes a second; a drawing has about a hundred
_CSV = (
    "type", "number", "record", "kind", "name", "value", "lower", "upper", "unit", "zone", "details", "datums", "refines",
    "face_records", "other_records", "end_face_records", "end_other_records", "faces", "end_faces", "features", "reason",
)  # fmt: skip
_TOLERANCES = ("", "kind", "value", "zone, modifiers", "datums", "faces", "declared as")
_DIMENSIONS = ("", "dimension", "nominal", "limits", "details", "faces", "declared as")
_DATUMS = ("", "faces", "targets", "declared as")
MIN_WIDTHS = {"dimension": 9, "declared as": 12, "faces": 11}  # of columns, so that no word in them is cut
MAX_FACES = 12  # in a cell
MAX_FEATURES = 6  # in a cell

Body = Annotated[str | None, typer.Option(help="Name or number of the body. Not needed for a file with a single body.")]
AsCsv = Annotated[bool, flag("--csv", "Print the tolerances and dimensions as CSV.")]
AsScript = Annotated[bool, flag("--script", "Print a model script that declares the parts with these tolerances.")]


@app.command(epilog=examples("pmi part.stp", "pmi part.stp --csv > part.csv", "pmi part.stp --script > part.py"))
def pmi(file: StepFile, as_json: AsJson = False, as_csv: AsCsv = False, as_script: AsScript = False) -> None:
    """List the tolerances, dimensions and datums of a STEP file of AP242, and how features declare them. In mm and rad."""
    only_one(json=as_json, csv=as_csv, script=as_script)
    with waiting(f"reading {file}"):
        information = read_pmi(file)
        declared = _declared(file, information)
    if as_script and information.is_empty:
        raise OptionError(f"{without_annotations(information, file)}, so there is nothing to declare")
    if as_script and not declared.parts:
        raise OptionError(f'"{file}": none of its tolerances, dimensions and datums applies to a face that is listed')
    if as_script:
        echo(script(file, declared), nl=False)
    elif as_csv:
        echo(_csv(declared), nl=False)
    elif information.is_empty and not as_json:
        echo(without_annotations(information, file))
    elif as_json:
        echo(json.dumps(_entries(declared), allow_nan=False))
    else:
        _print_tables(declared)


def _declared(file: Path, information: Pmi) -> DeclaredFile:
    """Return how features declare the annotations of a file; nothing, with a warning, if its shapes cannot be read."""
    if information.is_empty:
        return DeclaredFile((), (), information, (), {})
    try:
        declared = declared_file(file, information)
    except OptionError as error:
        echo(f"warning: nothing is declared, and faces have no numbers: {error}", err=True)
        return DeclaredFile((), (), information, (), {})
    for fault in declared.faults:
        echo(f"warning: nothing is declared of {fault}", err=True)
    return declared


def _entries(declared: DeclaredFile) -> dict[str, Any]:
    """Return everything for JSON: the statements of the file, its faces, and the outcome."""
    faces = {record: asdict(face) for record, face in declared.faces.items()}
    declarations = {
        entry.annotation.record: {"features": entry.features, "reason": entry.reason, "remark": entry.remark}
        for entry in declared.annotations
    }
    return asdict(declared.pmi) | {"faces": faces, "declared": declarations}


def without_annotations(information: Pmi, name: Path) -> str:
    """Return a sentence about a file without annotations, with the reason if it is known."""
    if not information.is_ap242:
        schema = clipped(information.schema, 100) or "not stated"
        return f'"{name}" is not an AP242 file (its schema is {schema}); tolerances and dimensions are read from AP242 only'
    details = ""
    if information.drawings:
        details += f"; its {information.drawings} annotations are only drawn, and drawings are not read"
    if information.is_tessellated:
        details += "; its shapes are triangles, without faces to which tolerances could apply"
    return f'"{name}" states no tolerances, dimensions or datums{details}'


def _print_tables(declared: DeclaredFile) -> None:
    output = console()
    width = output.width if sys.stdout.isatty() else FILE_WIDTH
    output.print(Text(str(declared.pmi), style="bold"))
    for part in (*_sections(declared), *_undeclared_lines(declared)):
        output.print(part, width=width)


def _sections(declared: DeclaredFile) -> Iterator[RenderableType]:
    """Yield the tables with their titles. Tables without rows are left out."""
    information = declared.pmi
    for title, columns, annotations in (
        ("tolerances [mm]", _TOLERANCES, information.tolerances),
        ("dimensions [mm]", _DIMENSIONS, information.dimensions),
        ("datums", _DATUMS, information.datums),
    ):
        if annotations:
            yield Text(f"\n{title}", style="bold")
            yield _table(columns, [_row(annotation, declared) for annotation in annotations[:MAX_ROWS]])
        if len(annotations) > MAX_ROWS:
            yield Text(f"and {len(annotations) - MAX_ROWS} more, which --json lists")
    listed: list[Annotation] = [*information.tolerances, *information.dimensions, *information.datums]
    if any(annotation.other_records and not annotation.face_records for annotation in listed):
        yield Text("\nin parentheses: edges, curves and points, where the file states no faces")
    bare = sum(not tolerance.face_records for tolerance in information.tolerances)
    if bare:
        yield Text(f"tolerances for which the file states no face: {bare}")
    if information.is_tessellated:
        yield Text("the shapes of the file are triangles, without faces")


def _undeclared_lines(declared: DeclaredFile) -> Iterator[RenderableType]:
    """Yield the annotations that are not declared, or only partly, with the reasons, and those with remarks."""
    numbers: dict[tuple[str, str], list[str]] = defaultdict(list)
    remarks: dict[str, list[str]] = defaultdict(list)
    for kind, noun in ((Tolerance, "tolerance"), (Dimension, "dimension"), (Datum, "datum")):
        for entry in declared.annotations:
            if isinstance(entry.annotation, kind) and entry.reason:
                reason = f"only in part, {entry.reason}" if entry.features else entry.reason
                numbers[noun, reason].append(_number(entry.annotation))
            if entry.remark:
                remarks[entry.remark].append(_number(entry.annotation))
    for remark, group in remarks.items():
        yield Text(shown(f"\ntolerance{'s' if len(group) > 1 else ''} {', '.join(group[:MAX_ROWS])}: {remark}"))
    if numbers:
        yield Text("\nnot declared", style="bold")
    for (noun, reason), group in numbers.items():
        yield Text(shown(f"{noun}{'s' if len(group) > 1 else ''} {', '.join(group[:MAX_ROWS])}: {reason}"))


def _number(annotation: Annotation) -> str:
    return annotation.letter if isinstance(annotation, Datum) else str(annotation.number)


def _table(columns: Sequence[str], rows: Sequence[Sequence[str]]) -> Table:
    """Return a table with wrapped cells that are never cut."""
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), show_edge=False)
    for column in columns:
        if column in ("value", "nominal"):
            table.add_column(column, justify="right", no_wrap=True)
        else:
            is_short = column in ("", "limits")
            table.add_column(column, no_wrap=is_short, overflow="fold", min_width=MIN_WIDTHS.get(column))
    for row in rows:
        table.add_row(*map(Text, row))
    return table


def _row(annotation: Annotation, declared: DeclaredFile) -> tuple[str, ...]:
    """Return the cells of an annotation, in the columns of its table."""
    places = _faces(annotation.face_records, annotation.other_records, declared.faces)
    names = next((entry.features for entry in declared.annotations if entry.annotation is annotation), ())
    more = f", and {len(names) - MAX_FEATURES} more" if len(names) > MAX_FEATURES else ""
    features = shown(", ".join(names[:MAX_FEATURES])) + more if names else "-"
    if isinstance(annotation, Datum):
        return shown(annotation.letter), places, ", ".join(map(str, annotation.targets)), features
    if isinstance(annotation, Tolerance):
        kind, value, system = annotation.kind or "not stated", _figure(annotation.value), annotation.datum_system
        return str(annotation.number), kind, value, annotation.details, system, places, features
    if annotation.end_face_records or annotation.end_other_records:
        places += f" to {_faces(annotation.end_face_records, annotation.end_other_records, declared.faces)}"
    limits = f"{_figure(annotation.lower)} to {_figure(annotation.upper)}".strip()
    unit = "" if annotation.unit in ("mm", "") else f" {annotation.unit}"
    name, nominal = shown(annotation.name) or annotation.kind, f"{_figure(annotation.nominal)}{unit}"
    return str(annotation.number), name, nominal, "" if limits == "to" else limits, annotation.details, places, features


def _faces(records: Sequence[int], others: Sequence[int], faces: FacesOfRecords) -> str:
    """Return the faces, or their count if they are unknown; without faces, the count of other items in parentheses."""
    if faces and records:
        known_faces = [faces[record] for record in records if record in faces][:MAX_FACES]
        kinds = dict.fromkeys(face.kind for face in known_faces)
        groups = [f"{kind} {', '.join(str(face) for face in known_faces if face.kind == kind)}".strip() for kind in kinds]
        more = len(records) - len(known_faces)
        return ", ".join([*groups, *([f"and {more} more"] if more else [])])
    return str(len(records)) if records or not others else f"({len(others)})"


def _figure(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _csv(declared: DeclaredFile) -> str:
    text = io.StringIO()
    declarations = {entry.annotation.record: ("; ".join(entry.features), entry.reason) for entry in declared.annotations}
    rows = csv.DictWriter(text, _CSV, lineterminator="\n")
    rows.writeheader()
    annotations: list[Tolerance | Dimension] = [*declared.pmi.tolerances, *declared.pmi.dimensions]
    for annotation in annotations:
        features, reason = declarations.get(annotation.record, ("", ""))
        row = {
            "number": annotation.number, "record": annotation.record, "kind": annotation.kind, "name": annotation.name,
            "details": annotation.details, "face_records": _numbers(annotation.face_records),
            "other_records": _numbers(annotation.other_records), "faces": _named(annotation.face_records, declared.faces),
            "features": features, "reason": reason,
        }  # fmt: skip
        if isinstance(annotation, Tolerance):
            row |= {
                "type": "tolerance", "value": annotation.value, "unit": "mm", "zone": annotation.zone,
                "datums": annotation.datum_system, "refines": annotation.refines,
            }  # fmt: skip
        else:
            row |= {
                "type": "dimension", "value": annotation.nominal, "lower": annotation.lower, "upper": annotation.upper,
                "unit": annotation.unit, "end_face_records": _numbers(annotation.end_face_records),
                "end_other_records": _numbers(annotation.end_other_records),
                "end_faces": _named(annotation.end_face_records, declared.faces),
            }  # fmt: skip
        rows.writerow({name: csv_cell(row.get(name)) for name in _CSV})
    return text.getvalue()


def _named(records: Sequence[int], faces: FacesOfRecords) -> str:
    return "; ".join(str(faces[record]) for record in records if record in faces)


def _numbers(records: Sequence[int]) -> str:
    return " ".join(map(str, records))


@app.command(epilog=examples("bodies parts.stp"))
def bodies(file: StepFile, as_json: AsJson = False) -> None:
    """List the bodies of a STEP file in its product tree: numbers, names, sizes in mm, faces; and its units of length."""
    with waiting(f"reading {file}"):
        listing = bodies_in(file)
    if as_json:
        _print_rows(listing)
        return
    if listing and listing[0].units:
        echo(f"lengths in the file: {listing[0].units}; here: mm, along x, y, z of the assembly")
    parents: tuple[str, ...] = ()
    for body in listing:
        *products, _ = body.path or ("",)
        for depth, name in enumerate(products):
            if parents[: depth + 1] != tuple(products[: depth + 1]):
                echo(f"{'  ' * depth}{shown_name(name)}")
        parents = tuple(products)
        echo(f"{'  ' * len(products)}{body}")


@app.command(epilog=examples("faces parts.stp --body lid"))
def faces(file: StepFile, body: Body = None, as_json: AsJson = False) -> None:
    """List the faces of a body of a STEP file: numbers (tc.select.Brep), kinds, axes, radii, areas, slots, hole patterns."""
    with waiting(f"reading {file}"):
        listing = faces_in(file, int(body) if body and re.fullmatch("[0-9]{1,9}", body) else body)
    if as_json:
        _print_rows(listing)
        return
    for line in (*listing, *group_lines(listing)):
        echo(line)


def _print_rows(rows: Sequence[Any]) -> None:
    echo(json.dumps([asdict(row) for row in rows]))
