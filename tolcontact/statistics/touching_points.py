"""The positions of contact points and how often they touch, from an archive."""

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms


def touching(results: xr.DataTree) -> xr.Dataset:
    """Return how often each contact point touches in the corrected state, as an archived share with its interval.

    touching   (point, interval): gaps below 1e-4 mm, in at most the first 2048 realizations (fewer above 10 000 points),
               without realizations that are `searched`
    pair       (point) name of its pair
    point      (point, axis) of the moving part, nominal [mm]

    The attribute `realizations` is their number. It is 0, and shares are NaN, if the archive does not keep the poses (or, where
    gaps depend on them, the deviations).
    """
    contact, names = results["contact"].to_dataset(), results.to_dataset()[terms.PAIR].values
    pair_of_point, points = np.zeros(0, dtype=int), np.zeros((0, len(terms.AXES)))  # for a model without contact
    if terms.PAIR_OF_POINT.name in contact:
        pair_of_point, points = contact[terms.PAIR_OF_POINT.name].values, contact[terms.MOVING_POINT.name].values
    values, count = np.full((len(pair_of_point), len(terms.ESTIMATE)), np.nan), 0
    if len(points):
        share, interval, realizations = (contact[variable.name].values for variable in terms.TOUCHING)
        values, count = np.column_stack([share, interval]), int(realizations)
    return xr.Dataset(
        {
            "touching": ((terms.POINT, terms.INTERVAL), values, {"units": "1"}),
            "point": ((terms.POINT, terms.AXIS), points, {"units": "mm"}),
        },
        coords={
            "pair": (terms.POINT, names.astype(str)[pair_of_point]),
            terms.AXIS: list(terms.AXES),
            terms.INTERVAL: list(terms.ESTIMATE),
        },
        attrs={"realizations": count},
    )
