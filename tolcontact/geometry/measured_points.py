"""Measured points of faces: files with a point in each line (CSV), or clouds and meshes (PLY). One file is one part."""

import re
from pathlib import Path

import numpy as np
import trimesh

from tolcontact.errors import GeometryFault
from tolcontact.input_files import check_inputs
from tolcontact.tables import MAX_NUMBER, number, text_of
from tolcontact.texts import clipped

MIN_FILES = 3  # smallest number of parts with a meaningful spread
EXPECTED = f"expected lines of three numbers x, y, z [mm] up to {MAX_NUMBER:g}, in the frame of the part"


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
    is_far = ~(np.abs(points) <= MAX_NUMBER).all(axis=1)  # or not a number
    if is_far.any():
        row = int(np.flatnonzero(is_far)[0])
        point = ", ".join(f"{coordinate:g}" for coordinate in points[row])
        raise GeometryFault(f'"{path}": point {row + 1} is ({point}); expected numbers up to {MAX_NUMBER:g}, so leave it out')
    return points


def _of_table(path: Path) -> np.ndarray:
    """Return the points of a table with commas, semicolons or blanks between columns, with or without a heading."""
    lines = [
        (k, line)
        for k, line in enumerate(text_of(path).split("\n"), start=1)
        if line.strip() and not line.lstrip().startswith("#")
    ]
    if lines and not re.search("[0-9]", lines[0][1]):  # a heading
        lines = lines[1:]
    points = np.empty((len(lines), 3))
    for row, (k, line) in enumerate(lines):
        try:
            x, y, z = map(number, line.replace(",", " ").replace(";", " ").split())
            points[row] = x, y, z
        except ValueError:
            advice = "; write decimals with points" if ";" in line and "," in line else ""
            raise ValueError(f'line {k} is "{clipped(line, 60)}"; {EXPECTED}{advice}') from None
    return points
