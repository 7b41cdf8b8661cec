"""The title block of a report: entries that identify a document in a customer's files."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

from tolcontact.declaration.values import is_line
from tolcontact.errors import OptionError
from tolcontact.vocabulary import TITLE_PREFIX

MAX_LENGTH = 200  # characters of an entry


@dataclass(frozen=True, kw_only=True)
class TitleBlock:
    """The title block of reports of an assembly; empty entries are left out.

    `tc.TitleBlock(part_number="4711", author="A. Person", revision="B", company="Works")` is an example; all entries are texts,
    `date` in any format. Without a `title`, reports have the name of the assembly.
    """

    title: str = ""
    part_number: str = ""
    author: str = ""
    revision: str = ""
    date: str = ""
    company: str = ""

    def faults(self) -> Iterator[str]:
        for name, value in self.entries.items():
            if not is_line(value):
                yield f"{name} is {value!r}; expected a text of one line"
            elif len(value) > MAX_LENGTH:
                yield f"{name} has {len(value)} characters; expected at most {MAX_LENGTH}"

    @property
    def entries(self) -> dict[str, str]:
        """All entries by name."""
        return dict(vars(self))

    @property
    def attributes(self) -> dict[str, str]:
        """The attributes of an archive that hold the entries that are not empty."""
        return {f"{TITLE_PREFIX}{name}": value for name, value in self.entries.items() if value}

    def overridden(self, entries: Mapping[str, str | None]) -> "TitleBlock":
        """Return the title block with other entries, where they are not None. Raises OptionError for a faulty one."""
        block = replace(self, **{name: value for name, value in entries.items() if value is not None})
        for fault in block.faults():
            raise OptionError(f"title block: {fault}")
        return block


def title_block_of(attributes: Mapping[Any, Any]) -> TitleBlock:
    """Return the title block from the attributes of an archive; empty if it has none."""
    names = [member.name for member in fields(TitleBlock)]
    return TitleBlock(**{name: str(attributes.get(f"{TITLE_PREFIX}{name}", "")) for name in names})
