"""What of the PMI of AP242 files becomes features: python -m studies.cad.pmi_parts FOLDER [--reasons].

For each STEP file: how many tolerances it states, how many of them have faces, and how many are declared wholly, in part and
not at all; how many sizes it states, and how many are declared; datums, features, patterns, contributors, and seconds of CPU
time. The counts of tolerances, sizes and datums are compared with those of names of entities in the text of the file. The last
table groups the reasons; with `--reasons` each tolerance that is not declared wholly stands there by itself.
"""

import argparse
import re
import resource
import time
from collections import Counter
from pathlib import Path

import numpy as np

import tolcontact as tc
from tolcontact.discretization import discretize
from tolcontact.errors import OptionError
from tolcontact.geometry.shapes import shape
from tolcontact.pmi import Datum, Dimension, Tolerance
from tolcontact.pmi.claims import DeclaredAnnotation
from tolcontact.pmi.declared import DeclaredFile, declared_file
from tolcontact.variation import Draws

COLUMNS = (
    "tolerances", "with faces", "wholly", "in part", "not", "sizes", "sizes declared", "datums", "datums declared", "features",
    "patterns", "contributors", "s",
)  # fmt: skip
LOCATORS = 6  # of a part
ENTITIES = {
    "tolerances": r"(?:GEOMETRIC|ANGULARITY|CIRCULAR_RUNOUT|COAXIALITY|CONCENTRICITY|CYLINDRICITY|FLATNESS|LINE_PROFILE|"
    r"PARALLELISM|PERPENDICULARITY|POSITION|ROUNDNESS|STRAIGHTNESS|SURFACE_PROFILE|SYMMETRY|TOTAL_RUNOUT)_TOLERANCE",
    "sizes": r"DIMENSIONAL_SIZE(?:_WITH_DATUM_FEATURE)?",
    "datums": r"DATUM",
}


def entity_counts(path: Path) -> dict[str, int]:
    """Return how many records of a file have an entity of some names, by the text alone."""
    text = re.sub(r"/\*.*?\*/|'(?:[^']|'')*'", "''", path.read_text(errors="replace"), flags=re.DOTALL)
    records = text.split(";")
    return {
        name: sum(bool(re.search(rf"(?<![A-Z_]){pattern}\s*\(", record)) for record in records)
        for name, pattern in ENTITIES.items()
    }


def row_of(declared: DeclaredFile, seconds: float) -> dict[str, float]:
    """Return the row of a file."""
    tolerances, sizes, datums = (
        [one for one in declared.annotations if isinstance(one.annotation, kind)] for kind in (Tolerance, Dimension, Datum)
    )
    sizes = [one for one in sizes if isinstance(one.annotation, Dimension) and one.annotation.kind == "size"]
    toleranced = [feature for part in declared.parts for feature in part.toleranced]
    patterns = sum(isinstance(feature, tc.declaration.Pattern) for feature in toleranced)
    counts = (
        len(tolerances), sum(bool(one.annotation.face_records) for one in tolerances),
        sum(not one.reason for one in tolerances), sum(bool(one.reason and one.features) for one in tolerances),
        sum(not one.features for one in tolerances), len(sizes), sum(not one.reason for one in sizes),
        len(datums), sum(not one.reason for one in datums), len(toleranced) - patterns, patterns,
        contributors(declared), round(seconds, 1),
    )  # fmt: skip
    return dict(zip(COLUMNS, counts, strict=True))


def contributors(declared: DeclaredFile) -> int:
    """Return the number of contributors of all parts, each held by six points that do not vary."""
    model = tc.Assembly("parts").replaced(parts=declared.parts)
    for part in declared.parts:
        low, high = shape(part.geometry).bounds
        x, y, _ = low + np.eye(3) * (high - low).max()
        points = {"z1": low, "z2": x, "z3": y, "y1": low, "y2": x, "x1": low}
        model.locate(part, [tc.Locator(name, point, name[0], 0.0) for name, point in points.items()])
        model.measure(f"origin of {part.name}", part.point(*low), along="z")
    return len(Draws(discretize(model)).contributors) - LOCATORS * len(declared.parts)


def grouped(one: DeclaredAnnotation) -> str:
    """Return the reason without its numbers and names."""
    reasons = re.split(r"; (?=faces|[a-z]+ \d|[A-Z]+:|\d+ of|it is for all)", one.reason)
    bare = [re.sub(r"^(?:faces [\d, ]+|[a-z]+ \d+|[A-Z]+): ", "", reason) for reason in reasons]
    return "; ".join(dict.fromkeys(re.sub(r"\d[\d.]*", "#", re.sub(r"datum [A-Z]+", "datum X", reason)) for reason in bare))


def main() -> None:
    """Print a row for each file of a folder, their sums, and the reasons."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--reasons", action="store_true", help="list each tolerance that is not declared wholly")
    arguments = parser.parse_args()
    print(f"| file | {' | '.join(COLUMNS)} | |\n|---|{'---:|' * len(COLUMNS)}---|")
    sums, reasons, listed = Counter[str](), Counter[str](), list[str]()
    for path in sorted(arguments.folder.glob("*.st*p")):
        start = time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        try:
            pmi = tc.io.read_pmi(path)
            if pmi.is_empty:
                print(f"| {path.name} |{' |' * len(COLUMNS)} it states no PMI as AP242 does |", flush=True)
                continue
            declared = declared_file(path, pmi)
        except OptionError as error:
            print(f"| {path.name} |{' |' * len(COLUMNS)} {error} |", flush=True)
            continue
        seconds = time.process_time() + resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - start
        row = row_of(declared, seconds)
        notes = [f"{name}: {count} by the text" for name, count in entity_counts(path).items() if count != row[name]]
        print(f"| {path.name} | {' | '.join(str(row[column]) for column in COLUMNS)} | {'; '.join(notes)} |", flush=True)
        sums.update(row)
        undeclared = [one for one in declared.annotations if one.reason and isinstance(one.annotation, Tolerance)]
        reasons.update(map(grouped, undeclared))
        listed += [f"{path.name}: {one}" for one in undeclared]
    print(f"| all | {' | '.join(f'{sums[column]:g}' for column in COLUMNS)} | |\n\n| tolerances | reason |\n|---:|---|")
    for reason, count in reasons.most_common():
        print(f"| {count} | {reason} |")
    if arguments.reasons:
        print("", *listed, sep="\n")


if __name__ == "__main__":
    main()
