"""Models as JSON files: read by the published schema, `model.schema.json` beside this file, and written by it.

A file that is read is checked by the schema, completed with what a script would leave out, and then read like the document of
an archive.
"""

import importlib  # jsonschema takes long to import: only if it is needed
import json
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from tolcontact.declaration.assembly import Assembly
from tolcontact.declaration.criteria import said_of
from tolcontact.declaration.document import Document, to_document
from tolcontact.declaration.geometry import Box
from tolcontact.declaration.part import Face, Part
from tolcontact.declaration.rebuilding import from_document
from tolcontact.declaration.tape import Tape
from tolcontact.declaration.vectors import direction
from tolcontact.errors import ArchiveError, ScriptError

SCHEMA = Path(__file__).with_name("model.schema.json")
DEFAULTS: dict[str, Document] = {  # of the things in each list
    "parts": {"at": [0, 0, 0], "rotation": [0, 0, 0], "fixed": None, "features": []},
    "features": {"tolerances": [], "datum": None},
    "locations": {"on": None, "tolerance": None},
    "scheme": {"one_sided": False, "stiffness": 1.0, "tolerance": None},
    "pairs": {"points": None, "spacing": None, "within": None},
    "measures": {"along": None, "tolerance": None, "units": "mm"},
    "forces": {},
    "variables": {"units": "mm"},
    "correlations": {},
    "populations": {"source": "given"},
}
LISTS = ("parts", "locations", "pairs", "measures", "forces", "variables", "correlations", "populations")


def read_json(path: Path) -> Assembly:
    """The assembly that a JSON file declares; files of shapes are named from its folder.

    Raises ScriptError, which states the place in the file, if it is not one.
    """
    where = f'model "{path}"'
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError) as error:
        raise ScriptError(f"{where} cannot be read as JSON: {error}") from error
    jsonschema = importlib.import_module("jsonschema")
    validator = jsonschema.Draft202012Validator(json.loads(SCHEMA.read_text(encoding="utf-8")))
    fault = jsonschema.exceptions.best_match(validator.iter_errors(document))
    if fault is not None:
        raise ScriptError(f"{where}: {fault.json_path.removeprefix('$.')}: {_in_words(fault)}")
    document.pop("$schema", None)
    for name in LISTS:
        document.setdefault(name, [])
        _complete(document[name], name, path.name)
    try:
        return from_document(document, _Files(path.parent, document["parts"]))
    except ArchiveError as wrong:
        said = str(wrong).removeprefix("the declared model in the archive is damaged: ")
        raise ScriptError(f"{where}: {said}") from wrong


def _in_words(error: Any) -> str:
    return str(error.message) if len(error.message) < 300 else f"{error.message[:300]}..."


class _Files(Mapping[str, Any]):
    """What each part with a file is made from."""

    def __init__(self, folder: Path, parts: list[Document]) -> None:
        self._of = {part["name"]: part["geometry"] for part in parts if "file" in part["geometry"]}
        self._folder = folder

    def __getitem__(self, name: str) -> Any:
        said = self._of[name]
        return {**said, "source": self._folder / said["file"]}

    def __iter__(self) -> Any:
        return iter(self._of)

    def __len__(self) -> int:
        return len(self._of)


def _complete(things: list[Document], kind: str, file: str) -> None:
    """Add what a script would leave out, to each of some things."""
    for number, thing in enumerate(things):
        for word, value in DEFAULTS[kind].items():
            thing.setdefault(word, value)
        thing.setdefault("declared_at", f"{file}: {kind}[{number}]")
        if kind == "parts":
            _complete(thing["features"], "features", file)
        if kind == "locations" and isinstance(thing["scheme"], list):
            _complete(thing["scheme"], "scheme", file)
        elif kind == "locations":
            thing["scheme"].setdefault("inset", 0.0)
        _make_plain(thing)


def _make_plain(thing: Document) -> None:
    """Words for directions, and numbers for tolerances, as an archive has them; also of what the thing consists of."""
    for word, value in thing.items():
        if word in ("along", "direction") and isinstance(value, str):
            thing[word] = list(direction(value))
        if word == "tolerance" and "of" not in thing and "tape" not in thing:
            thing[word] = _plain_tolerance(value)
        for inner in value if isinstance(value, list) else [value]:
            if isinstance(inner, dict) and word not in ("kwds", "drives", "select", "moving", "reference"):
                _make_plain(inner)
    if "scipy" in thing:
        thing.setdefault("args", [])
        thing.setdefault("kwds", {})


def _plain_tolerance(value: Any) -> Any:
    if isinstance(value, int | float):
        return {"range": value, "distribution": "normal"}
    return {"distribution": "normal", **value} if isinstance(value, dict) and "range" in value else value


def write_json(assembly: Assembly, path: Path, triangles: Callable[[Face], list[int]], tapes: Mapping[str, Tape]) -> None:
    """Write what an assembly declares as JSON; `triangles` gives those of faces that a function picks.

    Raises ScriptError for a shape that no file holds.
    """
    folder = path.resolve().parent

    def face(own: Face) -> Document:
        return {"part": own.part.name, "select": [said_of(each, own, triangles) for each in own.selections]}

    document = to_document(assembly, face, tapes, lambda part: _geometry(part, folder))
    text = json.dumps({"$schema": SCHEMA.name, **document}, indent=1, ensure_ascii=False)
    path.write_text(text + "\n", encoding="utf-8")


def _geometry(part: Part, folder: Path) -> Document:
    shape = part.geometry
    if isinstance(shape, Box):
        return {"box": [shape.x, shape.y, shape.z]}
    if not isinstance(shape.source, str | Path):
        raise ScriptError(f'part "{part.name}": its mesh is no file, so JSON cannot name it; save it as STL first')
    source = Path(shape.source).resolve()
    file = source.relative_to(folder) if source.is_relative_to(folder) else source
    rest = {word: value for word in ("units", "body", "chord") if (value := getattr(shape, word)) is not None}
    return {"file": file.as_posix(), **rest}
