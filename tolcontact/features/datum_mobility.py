"""The mobility of datums at their material boundary, "B(M)": a gauge element that the datum feature surrounds with play.

The frame of the gauge may be displaced from the datum feature, in the directions that this datum locks, by what the feature
departs from its boundary: a zone of the width of its own tolerances to the datums before, plus the departure of its size. This
holds where no mate is modelled; contact decides where one is. All that refers to the datum shares one gauge.
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

MOBILITY = "mobility"


def mobile(pattern: NominalPattern, free: np.ndarray, material: Material, start: int) -> NominalPattern | None:
    """Return a datum feature with the freedoms of its gauge element, from column `start` on; None if it has no play.

    free      (6, n): displacements about its centre that the datums before it leave free
    material  "M" or "L"
    """
    declared, member = pattern.declared, pattern.members[0]
    if not isinstance(declared, Feature) or not isinstance(member.geometry, FeatureOfSize) or member.size_column is None:
        return None
    own = min((tolerance.width for tolerance in declared.geometric if not tolerance.is_form and tolerance.datums), default=0.0)
    zone = GeometricTolerance(Position, own, material=material, rule=INSIDE)
    rows, added = zone_rows(zone, member.geometry, None), named_span(pattern.values @ free, pattern)
    layer = Layer(zone, (rows,), added, added, range(start, start + added.shape[1]), DatumFrame(np.zeros((6, start)), free, ()))
    labels = [f"{member.label}.{MOBILITY} {pattern.freedom_name(direction)}" for direction in added.T]
    motion = np.zeros((pattern.count, start + added.shape[1]))
    motion[:, start:] = added
    freedoms = tuple(Freedom(label, FEATURE, geometric=zone) for label in labels)
    return replace(
        pattern, members=(replace(member, mobility=motion),), layers=(layer,), freedoms=freedoms, shifts=(), form=None
    )
