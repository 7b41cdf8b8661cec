"""Checks of shape files before they are read: kind, size, announced numbers of elements, references to other files."""

import re
from pathlib import Path

from tolcontact.declaration.geometry import STEP
from tolcontact.errors import GeometryFault
from tolcontact.geometry.files.step_text import StepText
from tolcontact.texts import clipped

MESH_SUFFIXES = (".stl", ".obj", ".ply", ".glb", ".gltf")
HEAD_SIZE = 10_000  # [byte] at the beginning of a file, which show its kind
BYTE_ORDER_MARK = b"\xef\xbb\xbf"  # of UTF-8
_PLY_ELEMENT = re.compile(rb"^element (\w+) (\d+)", re.MULTILINE)
# The beginnings of files with a wrong suffix, and the advice for each.
_BEGINNINGS = (
    (b"ISO-10303-21", "a STEP file", "rename it to .step"),
    (b"glTF", "a GLB file", "rename it to .glb"),
    (b"ply\n", "a PLY file", "rename it to .ply"),
    (b"ply\r", "a PLY file", "rename it to .ply"),
    (b"solid ", "an STL file", "rename it to .stl"),
    (b"PK\x03\x04", "a ZIP archive", "unpack it, and give the file that it holds"),
    (b"\x1f\x8b", "a gzip archive", "unpack it, and give the file that it holds"),
    (b"%PDF", "a PDF document", "export the shape itself"),
    (b"<!doctype html", "a web page (HTML)", "download the file itself"),
    (b"<html", "a web page (HTML)", "download the file itself"),
    (b"<?xml", "an XML document", "export it as STEP or STL"),
)
_SIGNATURES = {".stl": (b"solid ",), ".ply": (b"ply\n", b"ply\r"), ".glb": (b"glTF",)}


def kind(path: Path) -> str:
    """Return the kind of a file by its suffix: "step", "stl", "obj", ..."""
    suffix = path.suffix.lower()
    return "step" if suffix in STEP else suffix.removeprefix(".")


def screen(path: Path, max_triangles: int) -> StepText | None:
    """Check a shape file, and return the statements in the text of a STEP file.

    Raises GeometryFault if the file announces more than `max_triangles`, or cannot be read correctly.
    """
    suffix = path.suffix.lower()
    if suffix not in (*MESH_SUFFIXES, *STEP):
        raise GeometryFault(f'"{path}": unknown kind of file; expected one of {", ".join((*MESH_SUFFIXES, *STEP))}')
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(HEAD_SIZE)
    except OSError as error:
        raise GeometryFault(f'"{path}" cannot be opened ({error.strerror})') from error
    if size == 0:
        raise GeometryFault(f'"{path}" is empty; export it again')
    is_binary_stl = suffix == ".stl" and size == _stl_size(head)  # its first 80 bytes are free text
    if not is_binary_stl:
        _check_kind(path, head)
    count = _announced_triangles(path, head, size)
    if count > max_triangles:
        raise GeometryFault(too_many(path, count, max_triangles))
    match suffix:
        case ".stl" if not is_binary_stl:
            _check_stl(path, head, size)
        case ".ply":
            _check_ply(path, head, size)
        case ".glb":
            length = int.from_bytes(head[8:12], "little")
            if length > size:
                raise GeometryFault(
                    f'"{path}" is cut off: its header states {length} bytes, but it has {size}; export it again'
                )
        case ".step" | ".stp":
            return _check_step(path)
    return None


def too_many(shape: object, count: int, limit: int) -> str:
    """Return the message about a shape whose `count` of triangles exceeds the limit."""
    return (
        f'"{shape}" holds {count} triangles, more than the limit of {limit}; contact points need no finer mesh than '
        "their spacing, so simplify it"
    )


def _stl_size(head: bytes) -> int:
    """Return the size [byte] of a binary STL file, from its `head`."""
    return 84 + 50 * int.from_bytes(head[80:84], "little")


def _check_kind(path: Path, head: bytes) -> None:
    suffix = path.suffix.lower()
    name = "STEP" if suffix in STEP else suffix[1:].upper()
    expected = (b"ISO-10303-21",) if suffix in STEP else _SIGNATURES.get(suffix, ())
    start = head.removeprefix(BYTE_ORDER_MARK).lstrip()
    for beginning, content, advice in _BEGINNINGS:
        if start[: len(beginning)].lower() == beginning.lower() and beginning not in expected:
            article = "an" if name in ("STL", "OBJ") else "a"
            raise GeometryFault(f'"{path}" is {content} by its content, not {article} {name} file; {advice}')
    if suffix in STEP and b"ISO-10303-21" not in head:
        raise GeometryFault(f'"{path}" is not a STEP file: it does not begin with ISO-10303-21; export it again')
    if suffix in (".ply", ".glb") and not start.startswith(_SIGNATURES[suffix]):
        raise GeometryFault(f'"{path}" is not a {name} file: it does not begin like one; export it again')


def _announced_triangles(path: Path, head: bytes, size: int) -> int:
    """Return the number of triangles that a file announces; 0 if that requires reading the entire file."""
    suffix = path.suffix.lower()
    if suffix == ".stl" and size == _stl_size(head):
        return int.from_bytes(head[80:84], "little")
    if suffix == ".ply":
        return next((int(count) for element, count in _PLY_ELEMENT.findall(head) if element == b"face"), 0)
    mark = {".stl": b"facet", ".obj": b"\nf "}.get(suffix)
    if mark is None:
        return 0
    with path.open("rb") as file:
        count = sum(chunk.count(mark) for chunk in iter(lambda: file.read(1 << 24), b""))
    return count // 2 if mark == b"facet" else count  # "facet" also occurs in "endfacet"


def _check_stl(path: Path, head: bytes, size: int) -> None:
    if head.lstrip().lower().startswith(b"solid") and (b"facet" in head or b"endsolid" in head):
        with path.open("rb") as file:
            file.seek(max(0, size - HEAD_SIZE))
            if b"endsolid" not in file.read().lower():
                raise GeometryFault(f'"{path}" is cut off: it does not end with "endsolid"; export it again')
        return
    if size < 84:
        raise GeometryFault(f'"{path}" is cut off, or not an STL file at all: it has {size} bytes; export it again')
    count, expected = int.from_bytes(head[80:84], "little"), _stl_size(head)
    fault = "is cut off, or not an STL file at all" if size < expected else "is damaged, or not an STL file at all"
    raise GeometryFault(
        f'"{path}" {fault}: it announces {count} triangles, which take {expected} bytes, but has {size}; export it again'
    )


def _check_ply(path: Path, head: bytes, size: int) -> None:
    if b"end_header" not in head:
        raise GeometryFault(f'"{path}" is not a PLY file, or cut off: its header does not end; export it again')
    rows = sum(int(count) for _, count in _PLY_ELEMENT.findall(head))
    if rows > size:  # each takes at least a byte
        raise GeometryFault(
            f'"{path}" is cut off or damaged: it announces {rows} vertices, faces and other elements, but has {size} bytes; '
            "export it again"
        )
    if b"format ascii" in head:
        lines = sum(1 for line in path.read_bytes().partition(b"end_header")[2].splitlines() if line.strip())
        if lines < rows:
            raise GeometryFault(f'"{path}" is cut off: it announces {rows} lines of numbers, but has {lines}; export it again')


def _check_step(path: Path) -> StepText:
    content = path.read_bytes()
    if content.startswith(BYTE_ORDER_MARK):
        raise GeometryFault(
            f'"{path}" begins with a byte order mark, which no STEP file has; save it as UTF-8 without this mark'
        )
    text = StepText(content)
    references = text.shape_files or (() if b"_SHELL" in content else text.documents)
    if references:
        names = ", ".join(f'"{clipped(name, 60)}"' for name in references[:5])
        names += f" and {len(references) - 5} more" if len(references) > 5 else ""
        raise GeometryFault(
            f'"{path}" refers to other files for shapes ({names}), which are not read; give the file of the part '
            "itself, or export it as one file without external references"
        )
    if b"END-ISO-10303-21" not in content:
        raise GeometryFault(f'"{path}" is cut off: it does not end with END-ISO-10303-21; export it again')
    if number := text.endless_number:
        raise GeometryFault(
            f'"{path}" is damaged: it holds the number {clipped(number, 40)}, which is not finite; export it again'
        )
    return text
