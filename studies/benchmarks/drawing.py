"""Drawings of problems: SVG made from shapes, each a line of text in a statement. Lengths in mm, y up; not to scale.

box X Y WIDTH HEIGHT [label]      with its lower x_min corner at X Y
circle X Y RADIUS [label]
polygon X Y X Y X Y ... [label]
line X Y X Y [label]
arrow X Y X Y [label]             with a head at both ends: a dimension
force X Y X Y [label]             with a head at its end
text X Y label
"""

from collections.abc import Callable
from html import escape
from itertools import takewhile

Points = list[tuple[float, float]]
WIDTH = 420.0  # of the picture
MARGIN = 0.09  # of the larger extent


def _is_number(word: str) -> bool:
    return word.lstrip("-").replace(".", "", 1).isdigit()


class Shape:
    """A shape: its kind, its numbers, and its label."""

    def __init__(self, text: str) -> None:
        self.kind, *words = text.split()
        numbers = list(takewhile(_is_number, words))[: COUNTS.get(self.kind)]
        self.numbers = [float(word) for word in numbers]
        self.label = " ".join(words[len(self.numbers) :])
        if self.kind not in ELEMENTS or len(numbers) < COUNTS.get(self.kind, 6):
            raise ValueError(f"the shape {text!r} is none of: {', '.join(ELEMENTS)}, with its numbers")

    @property
    def points(self) -> Points:
        """The points that it reaches to; of a circle and a box, opposite corners."""
        x, y, *lengths = self.numbers
        if self.kind == "box":
            return [(x, y), (x + lengths[0], y + lengths[1])]
        if self.kind == "circle":
            return [(x - lengths[0], y - lengths[0]), (x + lengths[0], y + lengths[0])]
        return list(zip(self.numbers[::2], self.numbers[1::2], strict=True))

    @property
    def is_upright(self) -> bool:
        """Whether it is a vertical line, whose label stands to its right."""
        return self.kind in ("line", "arrow", "force") and self.numbers[0] == self.numbers[2]

    @property
    def anchor(self) -> tuple[float, float]:
        """The place of its label: the middle; in a circle near the y_max, and at the tail of a force that is not upright."""
        if self.kind == "circle":
            x, y, radius = self.numbers
            return x, y + 0.7 * radius
        if self.kind == "force" and not self.is_upright:
            return self.points[0]
        xs, ys = zip(*self.points, strict=True)
        return (min(xs) + max(xs)) / 2, (min(ys) + max(ys)) / 2


def _box(p: Points) -> str:
    (x0, y0), (x1, y1) = p
    return f'<rect x="{x0:.1f}" y="{y1:.1f}" width="{x1 - x0:.1f}" height="{y0 - y1:.1f}" class="body"/>'


def _circle(p: Points) -> str:
    (x0, y0), (x1, y1) = p
    return f'<circle cx="{(x0 + x1) / 2:.1f}" cy="{(y0 + y1) / 2:.1f}" r="{(x1 - x0) / 2:.1f}" class="body"/>'


def _polygon(p: Points) -> str:
    return f'<polygon points="{" ".join(f"{x:.1f},{y:.1f}" for x, y in p)}" class="body"/>'


def _line(p: Points, heads: str = "") -> str:
    (x0, y0), (x1, y1) = p
    return f'<line x1="{x0:.1f}" y1="{y0:.1f}" x2="{x1:.1f}" y2="{y1:.1f}" class="line"{heads}/>'


ELEMENTS: dict[str, Callable[[Points], str]] = {
    "box": _box,
    "circle": _circle,
    "polygon": _polygon,
    "line": _line,
    "arrow": lambda p: _line(p, ' marker-start="url(#head)" marker-end="url(#head)"'),
    "force": lambda p: _line(p, ' marker-end="url(#head)"'),
    "text": lambda p: "",
}
COUNTS = {"box": 4, "circle": 3, "line": 4, "arrow": 4, "force": 4, "text": 2}  # numbers of a shape; a polygon has any
STYLE = (
    ".body { fill: #7aa2c833; stroke: #35618f; } .line { stroke: #888; } "
    "text { font: 12px sans-serif; fill: currentColor; text-anchor: middle; } .right { text-anchor: start; }"
)
HEAD = (
    '<marker id="head" viewBox="0 0 8 8" refX="7" refY="4" markerWidth="7" markerHeight="7" orient="auto-start-reverse">'
    '<path d="M0,0 L8,4 L0,8 z" fill="#888"/></marker>'
)


def svg(shapes: tuple[str, ...]) -> str:
    """Return the picture of these shapes. Raises ValueError for a line that is none."""
    elements = [Shape(text) for text in shapes]
    xs, ys = zip(*(point for shape in elements for point in shape.points), strict=True)
    margin = MARGIN * max(max(xs) - min(xs), max(ys) - min(ys))
    x_min, y_max = min(xs) - margin, max(ys) + margin
    scale = WIDTH / (max(xs) + margin - x_min)
    height = (y_max - min(ys) + margin) * scale

    def placed(points: Points) -> Points:
        return [((x - x_min) * scale, (y_max - y) * scale) for x, y in points]

    bodies = [ELEMENTS[shape.kind](placed(shape.points)) for shape in elements]
    labels = []
    for shape in elements:
        ((x, y),) = placed([shape.anchor])
        right, below = (6, 4) if shape.is_upright else (0, 4 if shape.kind in ("box", "polygon") else -4)
        place = f'x="{x + right:.1f}" y="{y + below:.1f}"' + (' class="right"' if shape.is_upright else "")
        labels.append(f"<text {place}>{escape(shape.label)}</text>" if shape.label else "")
    inside = "".join([f"<defs><style>{STYLE}</style>{HEAD}</defs>", *bodies, *labels])
    size = f'width="{WIDTH:.0f}" height="{height:.0f}" viewBox="0 0 {WIDTH:.0f} {height:.0f}"'
    return f'<svg xmlns="http://www.w3.org/2000/svg" {size} role="img">{inside}</svg>'
