"""Seams: the stations along a line of a part, at which gaps and flushes are measured."""

from collections.abc import Callable

from tolcontact.declaration.part import Point

MAX_STATIONS = 1000  # of a seam


def stations(start: Point, end: Point, count: int) -> tuple[Point, ...]:
    """Return `count` points of a part, evenly from `start` to `end`: the stations of a seam.

    `tc.stations(door.point(0, 40, 0), door.point(0, 40, 700), 5)`
    Points on a feature move with its deviation. Raises TypeError or ValueError for points of two parts or features.
    """
    if not (isinstance(start, Point) and isinstance(end, Point) and start.position and end.position):
        raise TypeError(
            f"stations: start is {start!r}, end is {end!r}; expected two points part.point(x, y, z), or two of a feature"
        )
    if start.part is not end.part or start.on is not end.on:
        raise ValueError(f"stations: {start} and {end} are not points of one part, or of one feature")
    if type(count) is not int or not 2 <= count <= MAX_STATIONS:
        raise ValueError(f"stations: count is {count!r}; expected a whole number from 2 to {MAX_STATIONS}")
    point: Callable[..., Point] = start.on.point if start.on else start.part.point
    shares = [k / (count - 1) for k in range(count)]
    return tuple(
        point(*((1 - share) * a + share * b for a, b in zip(start.position, end.position, strict=True))) for share in shares
    )
