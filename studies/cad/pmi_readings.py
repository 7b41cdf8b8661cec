"""Tolerances and dimensions as they are listed, beside the CAD kernel's reading: python -m studies.cad.pmi_readings FOLDER.

For each STEP file: how many are listed, how many of these the kernel reads, how many of these differ, and in what.
"""

import sys
from collections import Counter
from pathlib import Path

import tolcontact as tc
from tests.second_reading import second_reading


def counts(path: Path) -> tuple[Counter[str], list[str]]:
    """Return the counts of a file's row, and its differences in words."""
    pmi = tc.io.read_pmi(path)
    reading = second_reading(pmi, path, {})
    unread = {"tolerance": reading.unread_tolerances, "dimension": reading.unread_dimensions}
    row: Counter[str] = Counter({"only the kernel": len(reading.unlisted)})
    for annotation, listed in (("tolerance", pmi.tolerances), ("dimension", pmi.dimensions)):
        row[f"{annotation}s"] = len(listed)
        row[f"{annotation}s read"] = len(listed) - len(unread[annotation])
        row[f"{annotation}s differ"] = len({one.number for one in reading.differences if one.annotation == annotation})
    notes = [f"{annotation}s {', '.join(map(str, numbers))} are not read" for annotation, numbers in unread.items() if numbers]
    return row, [reading.fault] if reading.fault else [*notes, *map(str, reading.differences)]


def main() -> None:
    """Print a table over all files of a folder, and its sums."""
    columns = [*(f"{name}s{end}" for name in ("tolerance", "dimension") for end in ("", " read", " differ")), "only the kernel"]
    print(f"| file | {' | '.join(columns)} | |")
    print(f"|---|{'---:|' * len(columns)}---|")
    sums: Counter[str] = Counter()
    for path in sorted(Path(sys.argv[1]).glob("*.st*p")):
        row, notes = counts(path)
        sums.update(row)
        print(f"| {path.name} | {' | '.join(str(row[column]) for column in columns)} | {'; '.join(notes)} |", flush=True)
    print(f"| all | {' | '.join(str(sums[column]) for column in columns)} | |")


if __name__ == "__main__":
    main()
