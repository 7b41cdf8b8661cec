"""Read an archive with xarray and NumPy alone, and compute its least gaps again: read_plainly.py ARCHIVE."""

import sys

import numpy as np
import xarray as xr

root, contact, sample = (xr.load_dataset(sys.argv[1], group=group) for group in (None, "contact", "sample"))
for pair in range(root.sizes["pair"]):
    if "bounded" in contact and contact.bounded[pair]:  # its gaps are those of the bodies, not of contact points
        continue
    points = contact.isel(point=np.flatnonzero(contact.pair_of_point == pair))
    places, normal = {}, points.reference_normal.values.T
    for side in ("moving", "reference"):
        part, p = int(contact[f"{side}_part"][pair]), points[f"{side}_point"].values.T
        R, t = (root[name].isel(part=part).values for name in ("rotation", "translation"))
        places[side] = p if part < 0 else R @ p + t[..., None]
        if side == "reference" and part >= 0:
            normal = R @ normal
            normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    gaps = ((places["moving"] - places["reference"]) * normal).sum(axis=2)
    locators = points.locator_of_point.values
    gaps -= np.where(locators < 0, 0, sample.deviation.values[:, locators])[:, None]
    assert np.abs(gaps.min(axis=2) - root.gap_min.isel(pair=pair).values).max() < 1e-9, str(root.pair.values[pair])
assert not any(name.split(".")[0] == "tolcontact" for name in sys.modules)
print(*root.status.values)
