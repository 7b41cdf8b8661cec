"""Drawn features measured back: is the share inside their zones what the rules state?"""

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.discretization import discretize
from tolcontact.statistics.intervals import proportion_of
from tolcontact.variation import Draws
from tolcontact.variation.measured_population import measured_population
from tolcontact.workflow.run import Model, check_counts, declared


def check_population(model: Model, *, samples: int = 10_000, seed: int = 1) -> xr.Dataset:
    """Draw `samples` of every feature, and measure them as a coordinate measuring machine would.

    One zone for each size and tolerance, with
        share_inside  (zone, interval)  estimate, and its exact 95 % interval
        stated_share  (zone)            what the rule from zone to spread states; NaN if it states none
        needed_width  (zone) [mm]       width of the zone that 99.73 % of the features need
    Tolerances that are nested, or fill a bonus, may have a larger share inside than stated.
    """
    check_counts(samples=samples, seed=seed)
    nominal = discretize(declared(model))
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
    found = xr.Dataset(
        {v.name: (v.dims, np.array(of, dtype=v.kind), v.all_attributes) for v, of in values.items()},
        coords={terms.INTERVAL: list(terms.ESTIMATE)},
        attrs={"title": f"population of {nominal.assembly.name}", "realizations": samples, "seed": seed},
    )
    return found.set_coords([terms.ZONE_FEATURE.name, terms.ZONE_TOLERANCE.name])
