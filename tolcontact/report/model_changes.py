"""What changed in a model between two runs, from the documents in their archives."""

import json
from collections.abc import Iterator
from typing import Any

from tolcontact.texts import clipped

IGNORED = "declared_at", "title_block"  # lines of a script; the title block is stated elsewhere
MAX_VALUE = 60  # characters of a value


def model_changes(before: Any, after: Any, place: str = "") -> Iterator[str]:
    """Yield a sentence for each value that differs in two documents of models, such as "cover, H1, width: 0.2, now 0.1"."""
    if isinstance(before, dict) and isinstance(after, dict):
        for key in dict.fromkeys((*before, *after)):
            if key not in IGNORED:
                yield from _changes_at(before, after, key, _joined(place, key))
    elif isinstance(before, list) and isinstance(after, list) and _is_nested(before + after):
        old, new = _by_name(before), _by_name(after)
        for key in dict.fromkeys((*old, *new)):
            yield from _changes_at(old, new, key, _joined(place, key))
    elif before != after:
        yield f"{place}: {_shown(before)}, now {_shown(after)}"


def _changes_at(before: dict[str, Any], after: dict[str, Any], key: str, place: str) -> Iterator[str]:
    if key not in after:
        yield f"{place}: removed ({_shown(before[key])})"
    elif key not in before:
        yield f"{place}: added ({_shown(after[key])})"
    else:
        yield from model_changes(before[key], after[key], place)


def _by_name(entries: list[Any]) -> dict[str, Any]:
    """Return entries by their names, or by their kinds or numbers if they have none."""
    named: dict[str, Any] = {}
    for number, entry in enumerate(entries, start=1):
        labels = [entry.get(key) for key in ("name", "kind", "part")] if isinstance(entry, dict) else []
        name = next((label for label in labels if isinstance(label, str) and label), "")
        named[name if name and name not in named else f"{name} {number}".strip()] = entry
    return named


def _is_nested(entries: list[Any]) -> bool:
    return any(isinstance(entry, dict) for entry in entries)


def _joined(place: str, key: str) -> str:
    return f"{place}, {key}" if place else key


def _shown(value: Any) -> str:
    """Return a value in a line: the name of a thing, a number without the noise of computing it, or a clipped text."""
    if isinstance(value, dict) and "name" in value:
        return str(value["name"])
    if isinstance(value, float):
        return f"{value:.12g}"
    return clipped(value if isinstance(value, str) else json.dumps(value, ensure_ascii=False), MAX_VALUE)
