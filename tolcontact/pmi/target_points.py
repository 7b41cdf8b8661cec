"""Where datum targets are: points in the frame of their product, in mm."""

import math

from tolcontact.declaration.values import Vector
from tolcontact.pmi.aspects import TARGETS
from tolcontact.pmi.part21 import Parameters, Records
from tolcontact.pmi.quantities import length_unit

_SHAPE = "SHAPE_REPRESENTATION_WITH_PARAMETERS"
MAX_TARGETS = 10_000  # of a file; a drawing has some ten


def target_points(records: Records) -> dict[int, Vector]:
    """Return the places of datum targets [mm] by the numbers of their records, as far as a file states them."""
    shapes = {
        target: records.parameters(definition.reference(1), _SHAPE)
        for number in records.numbers("SHAPE_DEFINITION_REPRESENTATION")
        if (definition := records.parameters(number, "SHAPE_DEFINITION_REPRESENTATION"))
        and records.has(definition.reference(1), _SHAPE)
        and records.has(target := records.parameters(definition.reference(0), "PROPERTY_DEFINITION").reference(2), *TARGETS)
    }
    items = {item for shape in list(shapes.values())[:MAX_TARGETS] for item in shape.references(1)}
    placements = {number: item.reference(1) for number, item in records.shapes(*items).items()}
    coordinates = records.shapes(*placements.values())
    points = {}
    for target, shape in shapes.items():
        unit = length_unit(records, shape.reference(2))
        places = [coordinates.get(placements.get(item, 0), Parameters()) for item in shape.references(1)]
        point = next((point for place in places if (point := _point(place, unit or math.nan))), None)
        if point is not None:
            points[target] = point
    return points


def _point(coordinates: Parameters, unit: float) -> Vector | None:
    """Return a point [mm] from the parameters of its record; None if they are no finite coordinates."""
    values = coordinates.value(1)
    numbers = [value * unit for value in values if isinstance(value, float)] if isinstance(values, Parameters) else []
    return (numbers[0], numbers[1], numbers[2]) if len(numbers) == 3 and all(map(math.isfinite, numbers)) else None
