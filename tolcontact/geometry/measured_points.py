"""Measured points of faces: files with a point in each line (CSV), or clouds and meshes (PLY). One file is one part."""

from pathlib import Path

import numpy as np
import trimesh

from tolcontact.errors import GeometryFault

MIN_FILES = 3  # parts whose spread means something


def measured_points(pattern: str) -> dict[Path, np.ndarray]:
    """Return the points (point, 3) [mm] of each file that a path with wildcards in its last part names, by name.

    Raises GeometryFault for too few files, and for a file without points.
    """
    paths = sorted(Path(pattern).parent.glob(Path(pattern).name))
    if len(paths) < MIN_FILES:
        raise GeometryFault(
            f"measured={pattern!r} names {len(paths)} files; expected at least {MIN_FILES}, one for each measured part, "
            'as in "scans/*.csv"'
        )
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
    if points.ndim != 2 or points.shape[1] != 3 or not len(points) or not np.isfinite(points).all():
        raise GeometryFault(f'"{path}" has no points; expected lines of three numbers x, y, z [mm], in the frame of the part')
    return points


def _of_table(path: Path) -> np.ndarray:
    """Return the points of a table with commas, semicolons or blanks between columns, and a heading or none."""
    lines = path.read_text(encoding="utf-8-sig").replace(",", " ").replace(";", " ").splitlines()
    rows = [line.split() for line in lines if line.strip() and not line.lstrip().startswith("#")]
    if rows and not _is_number(rows[0][0]):
        rows = rows[1:]
    return np.array(rows, dtype=float).reshape(len(rows), -1)


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
