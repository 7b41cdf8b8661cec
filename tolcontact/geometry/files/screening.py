"""A first look at shape files, before anything reads them: kind, size, counts that they announce, files that they refer to."""

import re
from pathlib import Path

from tolcontact.declaration.geometry import STEP
from tolcontact.errors import GeometryFault, clipped
from tolcontact.geometry.files.step_text import StepText, step_text

MESHES = (".stl", ".obj", ".ply", ".glb", ".gltf")
HEAD = 10_000  # [byte] that are read to find out what a file is
_PLY_ELEMENT = re.compile(rb"^element (\w+) (\d+)", re.MULTILINE)
# How files begin that come under a wrong name, and what to do.
_MARKS = (
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
_OWN = {".stl": (b"solid ",), ".ply": (b"ply\n", b"ply\r"), ".glb": (b"glTF",)}


def kind(path: Path) -> str:
    """The reader that a file is for: "step", "stl", "obj", ..."""
    suffix = path.suffix.lower()
    return "step" if suffix in STEP else suffix.removeprefix(".")


def screen(path: Path, most: int) -> StepText | None:
    """Look at a file that may hold up to `most` triangles. Returns what the text of a STEP file states.

    Raises GeometryFault if the file plainly cannot be read, or not correctly.
    """
    suffix = path.suffix.lower()
    if suffix not in (*MESHES, *STEP):
        raise GeometryFault(f'"{path}": unknown kind of file; expected one of {", ".join((*MESHES, *STEP))}')
    try:
        size = path.stat().st_size
        with path.open("rb") as file:
            head = file.read(HEAD)
    except OSError as error:
        raise GeometryFault(f'"{path}" cannot be opened ({error.strerror})') from error
    if size == 0:
        raise GeometryFault(f'"{path}" is empty; export it again')
    whole_stl = suffix == ".stl" and size == _stl_size(head)  # whatever its free 80 bytes say
    if not whole_stl:
        _check_kind(path, head)
    count = _announced(path, head, size)
    if count > most:
        raise GeometryFault(too_many(path, count, most))
    match suffix:
        case ".stl" if not whole_stl:
            _check_stl(path, head, size)
        case ".ply":
            _check_ply(path, head, size)
        case ".glb":
            said = int.from_bytes(head[8:12], "little")
            if said > size:
                raise GeometryFault(f'"{path}" is cut off: its header states {said} bytes, but it has {size}; export it again')
        case ".step" | ".stp":
            return _check_step(path)
    return None


def too_many(what: object, count: int, most: int) -> str:
    """The message for a shape of `count` triangles, more than the `most`."""
    return (
        f'"{what}" holds {count} triangles, more than the limit of {most}; contact points need no finer mesh than '
        "their spacing, so simplify it"
    )


def _stl_size(head: bytes) -> int:
    """How many bytes a binary STL file has that begins so."""
    return 84 + 50 * int.from_bytes(head[80:84], "little")


def _check_kind(path: Path, head: bytes) -> None:
    suffix = path.suffix.lower()
    start = head.removeprefix(b"\xef\xbb\xbf").lstrip()
    for mark, what, advice in _MARKS:
        step = suffix in STEP and mark == b"ISO-10303-21"
        if start[: len(mark)].lower() == mark.lower() and not step and mark not in _OWN.get(suffix, ()):
            raise GeometryFault(f'"{path}" is {what} by its content, not {_article(suffix)} file; {advice}')
    if suffix in STEP and b"ISO-10303-21" not in head:
        raise GeometryFault(f'"{path}" is not a STEP file: it does not begin with ISO-10303-21; export it again')
    if suffix in (".ply", ".glb") and not start.startswith(_OWN[suffix]):
        raise GeometryFault(f'"{path}" is not a {suffix[1:].upper()} file: it does not begin like one; export it again')


def _article(suffix: str) -> str:
    kind = "STEP" if suffix in STEP else suffix[1:].upper()
    return f"an {kind}" if kind in ("STL", "OBJ") else f"a {kind}"


def _announced(path: Path, head: bytes, size: int) -> int:
    """How many triangles a file announces, as far as that is known without reading it all into memory."""
    suffix = path.suffix.lower()
    if suffix == ".stl" and size == _stl_size(head):
        return int.from_bytes(head[80:84], "little")
    if suffix == ".ply":
        return next((int(count) for element, count in _PLY_ELEMENT.findall(head) if element == b"face"), 0)
    mark = {".stl": b"facet", ".obj": b"\nf "}.get(suffix)
    if mark is None:
        return 0
    with path.open("rb") as file:
        found = sum(chunk.count(mark) for chunk in iter(lambda: file.read(1 << 24), b""))
    return found // 2 if mark == b"facet" else found  # "facet" also ends each one: "endfacet"


def _check_stl(path: Path, head: bytes, size: int) -> None:
    if head.lstrip().lower().startswith(b"solid") and (b"facet" in head or b"endsolid" in head):
        with path.open("rb") as file:
            file.seek(max(0, size - HEAD))
            if b"endsolid" not in file.read().lower():
                raise GeometryFault(f'"{path}" is cut off: it does not end with "endsolid"; export it again')
        return
    if size < 84:
        raise GeometryFault(f'"{path}" is cut off, or not an STL file at all: it has {size} bytes; export it again')
    count, expected = int.from_bytes(head[80:84], "little"), _stl_size(head)
    what = "is cut off, or not an STL file at all" if size < expected else "is damaged, or not an STL file at all"
    raise GeometryFault(
        f'"{path}" {what}: it announces {count} triangles, which take {expected} bytes, but has {size}; export it again'
    )


def _check_ply(path: Path, head: bytes, size: int) -> None:
    if b"end_header" not in head:
        raise GeometryFault(f'"{path}" is not a PLY file, or cut off: its header does not end; export it again')
    rows = sum(int(count) for _, count in _PLY_ELEMENT.findall(head))
    if rows > size:  # each takes a byte at least
        raise GeometryFault(
            f'"{path}" is cut off or damaged: it announces {rows} vertices, faces and other elements, but has {size} bytes; '
            "export it again"
        )
    if b"format ascii" in head:
        found = sum(1 for line in path.read_bytes().partition(b"end_header")[2].splitlines() if line.strip())
        if found < rows:
            raise GeometryFault(f'"{path}" is cut off: it announces {rows} lines of numbers, but has {found}; export it again')


def _check_step(path: Path) -> StepText:
    content = path.read_bytes()
    said = step_text(content)
    elsewhere = said.files or (() if b"_SHELL" in content else said.documents)
    if elsewhere:
        raise GeometryFault(
            f'"{path}" refers to other files for shapes ({_listed(elsewhere)}), which are not read; give the file of the part '
            "itself, or export it as one file without external references"
        )
    if b"END-ISO-10303-21" not in content:
        raise GeometryFault(f'"{path}" is cut off: it does not end with END-ISO-10303-21; export it again')
    return said


def _listed(names: tuple[str, ...]) -> str:
    first = ", ".join(f'"{clipped(name, 60)}"' for name in names[:5])
    return first + (f" and {len(names) - 5} more" if len(names) > 5 else "")
