"""Models as JSON files, and the JSON schema of these files."""

import json
from collections import Counter
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import msgspec

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.codec import definitions
from tolcontact.declaration.document import DOCUMENT, assembly_of, to_document
from tolcontact.declaration.geometry import Mesh
from tolcontact.declaration.measure import Tape
from tolcontact.declaration.part import Face
from tolcontact.declaration.place import EntryError, Sources
from tolcontact.errors import ScriptError, clipped

MAX_BYTES = 1 << 26  # of a file
SCHEMA_NAME = "model.schema.json"


def read_json(path: Path) -> Assembly:
    """Return the assembly that a JSON file declares; files of shapes are named from its folder.

    Defaults may be left out, as in a script. Raises ScriptError, which states the place in the file, for a file of another
    structure.
    """
    try:
        if (size := path.stat().st_size) > MAX_BYTES:
            raise ValueError(f"it has {size} bytes; expected at most {MAX_BYTES}")
        document = json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=_unique)
    except (OSError, ValueError, RecursionError) as error:
        raise ScriptError(f'model "{path}" cannot be read as JSON: {error}') from error
    try:
        return assembly_of(document, Sources({}, path.parent, path.name))
    except EntryError as error:
        raise ScriptError(f'model "{path}": {error}') from error


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return the named values of an object. Raises ValueError for a name that it has twice."""
    values = dict(pairs)
    if len(values) < len(pairs):
        name, _ = Counter(name for name, _ in pairs).most_common(1)[0]
        raise ValueError(f'"{clipped(name, 40)}" stands twice among the same named values; expected it once')
    return values


def write_json(assembly: Assembly, path: Path, triangles: Callable[[Face], list[int]], tapes: Mapping[str, Tape]) -> None:
    """Write the declarations of an assembly as JSON; `triangles` returns the triangles of a face that a function picks.

    Raises ScriptError for a shape that is not in a file.
    """
    for part in assembly.parts:
        if isinstance(part.geometry, Mesh) and not isinstance(part.geometry.source, str | Path):
            raise ScriptError(f'part "{part.name}": its mesh is no file, so JSON cannot name it; save it as STL first')
    document = to_document(assembly, triangles, tapes, path.resolve().parent)
    text = json.dumps({"$schema": SCHEMA_NAME, **document}, indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of a model as JSON: names, types, defaults and limits of all that is declared."""
    root = msgspec.json.schema_components([DOCUMENT], ref_template="#/$defs/{name}")[1]["Document"]
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        **root,
        "title": "tolcontact model",
        "description": "A declared assembly: lengths in mm, angles in rad, forces in N.",
        "$defs": definitions(),
    }


if __name__ == "__main__":
    print(json.dumps(json_schema(), indent=1))
