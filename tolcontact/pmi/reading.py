"""Reading of a STEP file's product and manufacturing information."""

import re
from pathlib import Path

from tolcontact.errors import OptionError
from tolcontact.pmi.annotations import Pmi
from tolcontact.pmi.aspects import Aspects
from tolcontact.pmi.datums import datums_of
from tolcontact.pmi.dimensions import dimensions_of
from tolcontact.pmi.part21 import Records
from tolcontact.pmi.tolerances import tolerances_of
from tolcontact.tables import fault_of
from tolcontact.texts import clipped

MAX_SIZE = 2_000_000_000  # [byte]; reading takes several times as much memory
HEAD_SIZE = 10_000  # [byte] of a file that show its kind
_EXPECTED = "expected a STEP file of AP242, edition 1 to 3 (.stp, .step)"
# Other kinds of files, by their beginnings and suffixes.
_KINDS = (
    (b"<QIFDocument", ".qif", "a QIF document"),
    (b"<?xml", ".stpx", "an XML document"),
    (b"PK\x03\x04", ".stpz", "a compressed file"),
    (b"\x1f\x8b", ".gz", "a compressed file"),
)
_AP242 = "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING"
_VERSION = re.compile(r"\{\s*1\s+0\s+10303\s+442\s+(\d{1,4})\b")
_EDITIONS = {1: 1, 2: 2, 3: 2, 4: 3}  # by the version in the object identifier of the schema
_TESSELLATED = ("TESSELLATED_SOLID", "TESSELLATED_SHELL", "TESSELLATED_CLOSED_SHELL", "TESSELLATED_OPEN_SHELL")


def read_pmi(path: str | Path) -> Pmi:
    """Return the geometric tolerances, dimensions and datums that a STEP file of AP242 (edition 1 to 3) at a `path` states.

    `tc.io.read_pmi("cover.stp").tolerances`
    Raises OptionError if it cannot be read, and for AP242 edition 4 and other kinds of files.
    """
    records = Records(_content(Path(path)), str(path))
    is_ap242 = records.schema.upper().startswith(_AP242)
    edition = _edition(records.schema, path) if is_ap242 else None
    is_tessellated = bool(records.numbers(*_TESSELLATED)) and not records.numbers("ADVANCED_FACE", "FACE_SURFACE")
    drawings = len(records.numbers(*(name for name in records.names() if name.endswith("ANNOTATION_OCCURRENCE"))))
    if not is_ap242:
        return Pmi(records.schema, None, False, is_tessellated, drawings, (), (), ())
    aspects = Aspects(records, str(path))
    annotations = tolerances_of(records, aspects), dimensions_of(records, aspects), datums_of(records, aspects)
    return Pmi(records.schema, edition, True, is_tessellated, drawings, *annotations)


def _content(path: Path) -> bytes:
    """Return the content of a STEP file. Raises OptionError for any other file."""
    if fault := fault_of(path, MAX_SIZE):
        raise OptionError(f'"{path}" {fault}; {_EXPECTED}')
    try:
        content = path.read_bytes()
    except OSError as error:
        raise OptionError(f'"{path}" cannot be opened ({error.strerror}); {_EXPECTED}') from error
    head = content[:HEAD_SIZE]
    if b"ISO-10303-21" in head:
        return content
    if not content:
        raise OptionError(f'"{path}" is empty; export it again')
    for beginning, suffix, kind in _KINDS:
        if beginning in head or path.suffix.lower() == suffix:
            raise OptionError(f'"{path}" is {kind}, which is not read; {_EXPECTED}')
    raise OptionError(f'"{path}" is not a STEP file: it does not begin with ISO-10303-21; {_EXPECTED}')


def _edition(schema: str, path: str | Path) -> int | None:
    """Return the edition of AP242 by the object identifier of its schema; None if that is not stated."""
    version = _VERSION.search(schema)
    if version is None:
        return None
    edition = _EDITIONS.get(int(version[1]))
    if edition is None:
        raise OptionError(
            f'"{path}" is AP242 edition 4 or later ({clipped(schema, 100)}), which is not read; export it as edition 1, 2 or 3'
        )
    return edition
