"""The mobility of datums at their material boundary, "B(M)": a gauge element that the datum feature surrounds with play.

The frame of the gauge may be displaced from the datum feature, in the directions that this datum locks, by what the feature
departs from its boundary: a zone of the width of its own tolerances to the datums before, plus the departure of its size. This
holds where no mate is modelled; contact decides where one is. Tolerances with the same datum system share one gauge in a
simultaneous requirement, the rule of ASME Y14.5; else each has one of its own (ISO 8015).
"""

from dataclasses import replace

import numpy as np

from tolcontact.declaration import Feature, GeometricTolerance
from tolcontact.declaration.feature_tolerance import INSIDE, Material, Position
from tolcontact.features.datum_frames import DatumFrame
from tolcontact.features.feature_geometry import FeatureOfSize
from tolcontact.features.freedoms import FEATURE, Freedom
from tolcontact.features.nominal_pattern import Layer, NominalPattern
from tolcontact.features.tolerance_kinds import zone_rows
from tolcontact.features.tolerance_layers import named_span


def mobile(pattern: NominalPattern, free: np.ndarray, material: Material, start: int, label: str) -> NominalPattern:
    """Return a datum feature with the freedoms of its gauge element, from column `start` on; without any if it has no play.

    free      (6, n): displacements about its centre that the datums before it leave free
    material  "M" or "L"
    label     of the freedoms, which their directions follow
    """
    declared, member = pattern.declared, pattern.members[0]
    added, layers = np.zeros((pattern.count, 0)), tuple[Layer, ...]()
    if isinstance(declared, Feature) and isinstance(member.geometry, FeatureOfSize) and member.size_column is not None:
        own = min(
            (tolerance.width for tolerance in declared.geometric if not tolerance.is_form and tolerance.datums), default=0.0
        )
        zone = GeometricTolerance(Position, own, material=material, rule=INSIDE)
        rows, added = zone_rows(zone, member.geometry, None), named_span(pattern.values @ free, pattern)
        frame = DatumFrame(np.zeros((6, start)), free, ())
        layers = (Layer(zone, (rows,), added, added, range(start, start + added.shape[1]), frame),)
    motion = np.zeros((pattern.count, start + added.shape[1]))
    motion[:, start:] = added
    freedoms = tuple(
        Freedom(f"{label}: {pattern.freedom_name(direction)}", FEATURE, geometric=layer.tolerance)
        for layer in layers for direction in added.T
    )  # fmt: skip
    return replace(pattern, members=(replace(member, mobility=motion),), layers=layers, freedoms=freedoms, shifts=(), form=None)
