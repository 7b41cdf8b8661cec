"""Tables in the pages of studies: a script writes each of its tables between marks of the README.

A table stands between `<!-- written by SCRIPT: NAME -->` and `<!-- end -->`.
"""

import math
import re
import shutil
from collections.abc import Mapping, Sequence
from pathlib import Path

MARKED = re.compile(r"(<!-- written by ([^>]+) -->\n)(.*?)(<!-- end -->)", re.DOTALL)
Table = Sequence[Sequence[object]]  # columns, then rows


def markdown(table: Table) -> str:
    """Return a table as Markdown."""
    columns, *rows = ([str(cell) for cell in row] for row in table)
    return "".join(f"| {' | '.join(row)} |\n" for row in (columns, ["---"] * len(columns), *rows))


def tables(page: Path) -> dict[str, str]:
    """Return the tables of a page by the names in their marks."""
    return {mark: text for _, mark, text, _ in MARKED.findall(page.read_text(encoding="utf-8"))}


def write(script: str, results: dict[str, Table], to: Path | None = None) -> None:
    """Print tables, and write them into the README beside a script, or into its copy in the folder `to`."""
    readme = Path(script).with_name("README.md")
    page = (to or readme.parent) / readme.name
    if not page.exists():
        shutil.copy(readme, page)
    texts = {f"{Path(script).name}: {name}": markdown(table) for name, table in results.items()}
    replace(page, texts)
    for name, table in texts.items():
        print(f"\n{name}\n{table}")


def replace(page: Path, texts: Mapping[str, str]) -> None:
    """Replace the texts between the marks of a page. Raises ValueError for a mark that is not there."""
    if unknown := set(texts) - set(tables(page)):
        raise ValueError(f"{page} has no marks of {', '.join(sorted(unknown))}")
    text = MARKED.sub(lambda match: match[1] + texts.get(match[2], match[3]) + match[4], page.read_text(encoding="utf-8"))
    page.write_text(text, encoding="utf-8")


def with_interval(value: float, lower: float, upper: float) -> str:
    """Return a value with its interval, rounded to two digits of the width of the interval; without if it has none."""
    width = upper - lower
    if math.isnan(width):
        return f"{value:.1g}"
    digits = max(0, 1 - math.floor(math.log10(width))) if 1e-12 < width < math.inf else 4
    cells = (f"{round(float(number), digits) + 0.0:.{digits}f}" for number in (value, lower, upper))  # no -0
    return "{} [{}, {}]".format(*cells)
