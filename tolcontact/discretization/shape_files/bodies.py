"""The bodies that a STEP file holds: which triangles are whose. A part is one of them. Lengths in mm.

A piece is what stands at one place of the file's product structure; a product may hold several solids. Triangles come
B-rep face by B-rep face, and solid by solid, so that a solid ends where what began with it is closed.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from tolcontact.discretization.edges import edges
from tolcontact.discretization.fault import clipped
from tolcontact.discretization.shape_files.step_text import Solid

SHOWN = 12  # bodies that a message lists


@dataclass(frozen=True)
class Body:
    """A body: its `name`, "" if it has none, and its corners (3,); None if its triangles are not known."""

    name: str
    lower: np.ndarray | None = None
    upper: np.ndarray | None = None
    is_open: bool = False

    def __str__(self) -> str:
        called = ("open, " if self.is_open else "") + (f'"{clipped(self.name, 60)}"' if self.name else "without a name")
        if self.lower is None or self.upper is None:
            return called
        size = " x ".join(f"{length:.4g}" for length in self.upper - self.lower)
        return f"{called}, {size} mm at ({', '.join(f'{x:.4g}' for x in (self.lower + self.upper) / 2)})"


@dataclass(frozen=True)
class Triangles:
    """Triangles of a STEP file: `corners` (face, 3, 3), and `faces` (face, 3) that share vertices wherever corners meet.

    piece, brep          (face,) the piece, and the B-rep face within it
    names                (piece,) what the file calls each piece
    coloured             (piece,) bool: of several colours, by which its B-rep faces are ordered, and not by solids
    """

    corners: np.ndarray
    faces: np.ndarray
    piece: np.ndarray
    brep: np.ndarray
    names: np.ndarray
    coloured: np.ndarray


def bodies(triangles: Triangles, solids: Sequence[Solid]) -> list[Body]:
    """The bodies of a file whose text names some `solids`."""
    pieces = np.unique(triangles.piece)
    if len(pieces) == 1:
        count = int(triangles.brep.max()) + 1
        if len(solids) == 1 and solids[0].faces >= count:
            return [_body(triangles, solids[0].name or triangles.names[pieces[0]], np.arange(len(triangles.faces)))]
        if sum(solid.faces for solid in solids) == count and not triangles.coloured[pieces[0]]:
            first = np.cumsum([0, *(solid.faces for solid in solids)])
            label = np.searchsorted(first, triangles.brep, side="right") - 1
            return [_body(triangles, solid.name, np.flatnonzero(label == k)) for k, solid in enumerate(solids)]
    found: list[Body] = []
    for k in pieces:
        found.extend(
            _body(triangles, triangles.names[k], *run) for run in _runs(triangles, np.flatnonzero(triangles.piece == k))
        )
    if len(pieces) == 1 and len(found) < len(solids):
        return [Body(solid.name) for solid in solids]
    return found


def listed(found: Sequence[Body]) -> str:
    """Some bodies with their numbers, names, sizes and places."""
    first = "; ".join(f"{number}. {body}" for number, body in enumerate(found[:SHOWN], start=1))
    return first + (f"; and {len(found) - SHOWN} more" if len(found) > SHOWN else "")


def _body(triangles: Triangles, name: str, chosen: np.ndarray, is_open: bool = False) -> Body:
    if not len(chosen):
        return Body(name)
    corners = triangles.corners[chosen].reshape(-1, 3)
    return Body(name, corners.min(axis=0), corners.max(axis=0), is_open)


def _runs(triangles: Triangles, own: np.ndarray) -> list[tuple[np.ndarray, bool]]:
    """The bodies in the piece that consists of its `own` triangles, by their indices, without cavities. Is the body open?

    Sheets that do not close are one body together: surfaces of a part need not be sewn.
    """
    order = own[np.argsort(triangles.brep[own], kind="stable")]
    brep = triangles.brep[order]
    ends_at = np.flatnonzero(_open_edges(triangles.faces[order], brep) == 0)
    runs = np.searchsorted(ends_at, brep, side="left")
    closed = [order[runs == k] for k in np.unique(runs[runs < len(ends_at)])]
    rest = order[runs == len(ends_at)]
    outer = [run for run in closed if _volume(triangles.corners[run]) >= 0]
    outer.extend(run for run in closed if _volume(triangles.corners[run]) < 0 and not _within(triangles, run, outer))
    return [*((run, False) for run in outer), *([(rest, True)] if len(rest) else [])]


def _open_edges(faces: np.ndarray, brep: np.ndarray) -> np.ndarray:
    """How many edges the first 1, 2, ... B-rep faces leave open: those that they run along more often in one sense."""
    ends, edge, _ = edges(faces)
    order = np.lexsort((np.repeat(brep, 3), edge))
    edge, at = edge[order], np.repeat(brep, 3)[order]
    sense = np.where(ends[order, 0] < ends[order, 1], 1, -1)
    new = np.r_[True, edge[1:] != edge[:-1]]
    total = np.cumsum(sense)
    total -= np.repeat((total - sense)[new], np.diff(np.r_[np.flatnonzero(new), len(edge)]))
    is_open = total != 0
    was_open = np.r_[False, is_open[:-1]] & ~new
    change = np.bincount(at, is_open.astype(int) - was_open.astype(int), int(brep.max()) + 1)
    return np.asarray(np.cumsum(change).astype(int))


def _volume(corners: np.ndarray) -> float:
    about = corners - corners.mean(axis=(0, 1))
    return float(np.einsum("ij,ij->", about[:, 0], np.cross(about[:, 1], about[:, 2])) / 6)


def _within(triangles: Triangles, run: np.ndarray, others: Sequence[np.ndarray]) -> bool:
    """Whether the box around one run of triangles lies in that around another one."""
    own = triangles.corners[run].reshape(-1, 3)
    boxes = [triangles.corners[other].reshape(-1, 3) for other in others]
    return any((box.min(axis=0) <= own.min(axis=0)).all() and (box.max(axis=0) >= own.max(axis=0)).all() for box in boxes)
