"""Problems of the suite: a statement in JSON and, beside it, a script with the reference solutions and the model.

A problem NAME is `problems/NAME.json` and `problems/NAME.py`; nothing lists them. The statement has these entries:

    title, section  the section is one of SECTIONS
    statement       a text; {name} stands for one of the numbers
    numbers         all numbers of the statement, by name [mm, N, degrees or 1, as the statement says]
    drawing         shapes (see drawing.py)
    quantities      what is asked: name, units, the expected value, and its tolerance, half of the last digit stated
    source          where problem and answer come from
    difficulty      what makes it hard
    unsupported     the reason why tolcontact does not answer; left out where it does

The script has `solution()` and `check()`, which return the expected values in two ways that share nothing, with NumPy and SciPy
alone, and, unless unsupported, `answers()`, which computes them with tolcontact from the model `assembly()`. So it is a model
script, too: `python -m tolcontact run studies/benchmarks/problems/NAME.py`.
"""

import importlib
import json
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

FOLDER = Path(__file__).resolve().parent / "problems"
SECTIONS = (
    "stacks and linkages", "over-constrained", "unilateral contact", "assemblability", "geometric tolerances", "rare events",
    "worst case", "allocation and contributions", "form", "stations", "springs and compliance", "friction", "CAD",
)  # fmt: skip
KEYS = {"title", "section", "statement", "numbers", "drawing", "quantities", "source", "difficulty"}


@dataclass(frozen=True)
class Quantity:
    """A quantity that is asked for, its expected value, and the tolerance of that value."""

    name: str
    units: str
    expected: float
    tolerance: float

    @property
    def label(self) -> str:
        """The name with units."""
        return self.name if self.units == "1" else f"{self.name} [{self.units}]"


@dataclass(frozen=True)
class Problem:
    """A statement with its quantities."""

    name: str
    title: str
    section: str
    text: str
    numbers: dict[str, Any]
    drawing: tuple[str, ...]
    quantities: tuple[Quantity, ...]
    source: str
    difficulty: str
    unsupported: str | None

    @property
    def script(self) -> ModuleType:
        """The script with reference solutions and model."""
        return importlib.import_module(f"studies.benchmarks.problems.{self.name}")


def read(name: str) -> Problem:
    """Return the problem of this name. Raises ValueError for a statement with unknown or missing entries."""
    path = FOLDER / f"{name}.json"
    entries = json.loads(path.read_text(encoding="utf-8"))
    if (wrong := KEYS ^ (entries.keys() - {"unsupported"})) or entries["section"] not in SECTIONS:
        raise ValueError(f"{path}: expected the entries {sorted(KEYS)} and a section of {SECTIONS}; look at {sorted(wrong)}")
    quantities = tuple(Quantity(*row) for row in entries["quantities"])
    return Problem(
        name, entries["title"], entries["section"], entries["statement"].format(**entries["numbers"]), entries["numbers"],
        tuple(entries["drawing"]), quantities, entries["source"], entries["difficulty"], entries.get("unsupported"),
    )  # fmt: skip


def names() -> list[str]:
    """Return the names of all problems, section by section."""
    stems = [path.stem for path in sorted(FOLDER.glob("*.json"))]
    return sorted(stems, key=lambda name: SECTIONS.index(read(name).section))


def problems(selection: Iterable[str] = ()) -> list[Problem]:
    """Return the problems with these names, or all. Raises ValueError for a name that is none."""
    known_names, selection = names(), list(selection)
    if unknown := [name for name in selection if name not in known_names]:
        raise ValueError(f"no problem is named {', '.join(unknown)}; the problems are: {', '.join(known_names)}")
    return [read(name) for name in selection or known_names]


def numbers(script: str) -> SimpleNamespace:
    """Return the numbers of the statement beside a script, given its `__file__`."""
    return SimpleNamespace(**json.loads(Path(script).with_suffix(".json").read_text(encoding="utf-8"))["numbers"])
