"""Pictures of dimension chains: the links as arrows, one after the other, and the gap that they close."""

from collections.abc import Iterable, Mapping
from typing import Any

from tolcontact.declaration import Variable
from tolcontact.report.figures import plain

MAX_LINKS = 60  # of a picture
LEFT, RIGHT, ROW = 190.0, 640.0, 24.0  # ends of the drawing, and the height of a row, in units of the picture
TICK = 3.0  # shortest length of an arrow; a shorter one is a tick


def loops_of(chains: Mapping[str, Mapping[str, Any]], variables: Iterable[Variable]) -> dict[str, list[dict[str, Any]]]:
    """Return the rows of the picture of each chain of dimensions, by the name of its measure; the last row is the gap.

    chains   entries of chains in a document, by the names of their measures
    """
    dimensions = {variable.name: variable for variable in variables if variable.nominal is not None}
    return {
        name: _rows(name, chain, dimensions)
        for name, chain in chains.items()
        if any(label in dimensions for label in chain["sensitivities"]) and len(chain["sensitivities"]) <= MAX_LINKS
    }


def _rows(gap: str, chain: Mapping[str, Any], dimensions: Mapping[str, Variable]) -> list[dict[str, Any]]:
    """Return name, text, ends, height and kind of each arrow of a chain."""
    links = []
    for name, factor in chain["sensitivities"].items():
        if name in dimensions:
            times = "" if abs(factor) == 1 else f"{abs(factor):g} times "
            links.append((name, factor * float(dimensions[name].nominal or 0), f"{times}{dimensions[name].drawn}"))
    offset = float(chain.get("nominal", 0.0))
    links += [("constant", offset, plain(offset))] if offset else []
    places = [0.0]
    for _, length, _ in links:
        places.append(places[-1] + length)
    low, high = min(places), max(places)
    ends = [LEFT + (place - low) * (RIGHT - LEFT) / (high - low or 1.0) for place in places]
    arrows = [
        (name, text, start, end, "down" if length < 0 else "up")
        for (name, length, text), start, end in zip(links, ends, ends[1:], strict=False)
    ]
    arrows.append((gap, plain(places[-1]), ends[0], ends[-1], "gap"))
    names = ("name", "text", "start", "end", "kind", "y", "is_tick")
    return [
        dict(zip(names, (*arrow, ROW * (k + 0.5), abs(arrow[3] - arrow[2]) < TICK), strict=True))
        for k, arrow in enumerate(arrows)
    ]
