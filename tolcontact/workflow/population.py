"""Populations of features, drawn and measured against their zones."""

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.discretization import discretize
from tolcontact.statistics.intervals import proportion_of
from tolcontact.variation import Draws
from tolcontact.variation.measured_population import measured_population
from tolcontact.workflow.forecast import check_memory
from tolcontact.workflow.models import Model, assembly_of, check_counts


def check_population(model: Model, *, samples: int = 10_000, seed: int = 1) -> xr.Dataset:
    """Draw `samples` of every feature, and measure them as a coordinate measuring machine would.

    The result has one zone for each size and each tolerance:

        share_inside  (zone, interval)  estimate, and its exact 95 % interval
        stated_share  (zone)            share according to the rule from zone to spread; NaN if it states none
        needed_width  (zone) [mm]       width of the zone that 99.73 % of the features need

    Nested tolerances, and tolerances that fill a bonus, may have a larger share inside than stated.
    """
    check_counts(samples=samples, seed=seed)
    nominal = discretize(assembly_of(model))
    check_memory(samples, len(nominal.contributors))
    zones = list(measured_population(nominal, Draws(nominal), seed=seed, count=samples))
    values = {
        terms.ZONE_FEATURE: [zone.feature for zone in zones],
        terms.ZONE_TOLERANCE: [zone.tolerance for zone in zones],
        terms.STATED_SHARE: [zone.stated for zone in zones],
        terms.SHARE_INSIDE: np.array([proportion_of(zone.inside, zone.drawn) for zone in zones]).reshape(
            -1, len(terms.ESTIMATE)
        ),
        terms.NEEDED_WIDTH: [zone.needed for zone in zones],
    }
    population = xr.Dataset(
        {v.name: (v.dims, np.array(column, dtype=v.kind), v.all_attributes) for v, column in values.items()},
        coords={terms.INTERVAL: list(terms.ESTIMATE)},
        attrs={"title": f"population of {nominal.assembly.name}", "realizations": samples, "seed": seed},
    )
    return population.set_coords([terms.ZONE_FEATURE.name, terms.ZONE_TOLERANCE.name])
