"""Measured points of faces: files with a point in each line (CSV), or clouds and meshes (PLY). One file is one part."""

import re
from pathlib import Path

import numpy as np
import trimesh

from tolcontact.errors import GeometryFault
from tolcontact.input_files import check_inputs

MIN_FILES = 3  # smallest number of parts with a meaningful spread
NUMBER = re.compile(r"[+-]?([0-9]+\.?[0-9]*|\.[0-9]+)([eE][+-]?[0-9]+)?|[+-]?(inf|nan)", re.IGNORECASE)
EXPECTED = "expected lines of three numbers x, y, z [mm], in the frame of the part"


def measured_points(pattern: str) -> dict[Path, np.ndarray]:
    """Return the points (point, 3) [mm] of each file that matches a path with wildcards in its last part, by name.

    Raises GeometryFault for too few files, and for a file without points.
    """
    try:
        paths = sorted(Path(pattern).parent.glob(Path(pattern).name))
    except (OSError, ValueError) as error:
        raise GeometryFault(f"measured={pattern!r} cannot be read: {error}") from error
    if len(paths) < MIN_FILES:
        raise GeometryFault(
            f"measured={pattern!r} names {len(paths)} files; expected at least {MIN_FILES}, one for each measured part, "
            'as in "scans/*.csv"'
        )
    try:
        check_inputs(paths)
    except (OSError, ValueError) as error:
        raise GeometryFault(f"measured={pattern!r} cannot be read: {error}") from error
    return {path: _points(path) for path in paths}


def _points(path: Path) -> np.ndarray:
    """Return the points (point, 3) [mm] of a file."""
    try:
        if path.suffix.lower() == ".ply":
            points = np.asarray(trimesh.load(path, process=False).vertices, dtype=float)
        else:
            points = _of_table(path)
    except (OSError, ValueError, IndexError, KeyError) as error:
        raise GeometryFault(f'"{path}" cannot be read as measured points: {error}') from error
    if not len(points):
        raise GeometryFault(f'"{path}" has no points; {EXPECTED}')
    if not np.isfinite(points).all():
        row = int(np.flatnonzero(~np.isfinite(points).all(axis=1))[0])
        point = ", ".join(f"{coordinate:g}" for coordinate in points[row])
        raise GeometryFault(f'"{path}": point {row + 1} is ({point}); expected finite numbers, so leave it out')
    return points


def _of_table(path: Path) -> np.ndarray:
    """Return the points of a table with commas, semicolons or blanks between columns, with or without a heading."""
    lines = path.read_text(encoding="utf-8-sig").splitlines()
    rows = [
        (number, line.replace(",", " ").replace(";", " ").split())
        for number, line in enumerate(lines, start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if rows and not re.search("[0-9]", lines[rows[0][0] - 1]):  # a heading
        rows = rows[1:]
    for number, row in rows:
        if len(row) != 3 or not all(map(NUMBER.fullmatch, row)):
            advice = "; write decimals with points" if ";" in lines[number - 1] and "," in lines[number - 1] else ""
            raise ValueError(f"line {number} is {lines[number - 1][:60]!r}; {EXPECTED}{advice}")
    return np.array([row for _, row in rows], dtype=float).reshape(-1, 3)
