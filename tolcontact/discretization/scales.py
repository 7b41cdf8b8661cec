"""The scales of contributors, and the refusal of deviations that are as large as the nominal size or the part."""

from collections.abc import Iterator

import numpy as np

from tolcontact.declaration.scale import CONSTANT_SHARE, Scale, doubt_of_distribution, doubt_of_rows
from tolcontact.discretization.nominal import Nominal
from tolcontact.errors import designation
from tolcontact.features.freedoms import LOCATOR, Freedom

SIGMA_QUANTILES = np.array([0.1587, 0.5, 0.8413])


def scales(nominal: Nominal) -> dict[str, Scale]:
    """Return the scales of locators and features by their labels; only locators and sizes have zones."""
    by_label = dict[str, Scale]()
    for part in nominal.parts:
        R_WP, t_WP = part.placement
        extent = float(np.ptp(part.mesh.bounds, axis=0).max())
        coordinates = (((part.locators.points - t_WP) @ R_WP) * (part.locators.directions @ R_WP)).sum(axis=1)
        for label, coordinate, tolerance in zip(part.locators.labels, coordinates, part.locators.tolerances, strict=True):
            by_label[label] = Scale(extent, 0.0, float(coordinate), float(tolerance.range or 0.0), float(tolerance.shift))
    for pattern in nominal.patterns:
        size, extent = pattern.declared.size, float(np.ptp(nominal.meshes[pattern.declared.part].bounds, axis=0).max())
        for freedom in pattern.freedoms:
            by_label[freedom.label] = Scale(extent)
            if size is not None and freedom.label.endswith(".size"):
                zone = size.upper - size.lower, (size.upper + size.lower) / 2
                by_label[freedom.label] = Scale(extent, size.nominal, size.nominal, *zone)
    return by_label


def centre_and_width(freedom: Freedom) -> tuple[float, float]:
    """Return the median of a freedom's distribution, and six standard deviations by its quantiles at one sigma."""
    low, centre, high = freedom.deviations(SIGMA_QUANTILES)
    return float(centre), float(3 * (high - low))


def scale_faults(nominal: Nominal) -> Iterator[str]:
    """Yield a fault for each population or distribution with deviations as large as the nominal size or the part."""
    by_label = scales(nominal)
    for population in nominal.assembly.populations:
        for label, values in zip(population.columns, population.values.T, strict=True):
            rows = np.flatnonzero(np.abs(values) >= by_label[label].limit) if label in by_label else np.zeros(0, dtype=int)
            if len(rows):
                doubt = doubt_of_rows(by_label[label], label, values) or "leave the row out, or mend it"
                place, row = designation("population", population), rows[0]
                yield f"{place}: row {row + 1} is a deviation of {values[row]:.6g} mm; {doubt}"
    reported = set[str]()
    for freedom in nominal.freedoms:
        part = freedom.label.rpartition(".")[0]
        if freedom.source == LOCATOR and part not in reported:  # the locators of a part mostly have one tolerance
            centre, width = centre_and_width(freedom)
            scale = by_label[freedom.label]
            if abs(centre) >= scale.limit and width > CONSTANT_SHARE * scale.part:  # a constant parks a locator
                reported.add(part)
                yield f'locator "{freedom.label}": {doubt_of_distribution(scale, centre, width)}'
