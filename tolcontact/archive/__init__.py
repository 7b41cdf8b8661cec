"""The archive: a netCDF file that holds a run, its realizations and the model. A chapter of the guide.

The file is netCDF-4 with CF attributes. It can be read without tolcontact: with xarray, ncdump, or MATLAB.

>>> import tempfile
>>> from pathlib import Path
>>> import numpy as np
>>> import xarray as xr
>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
>>> location = stand.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=1)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z", tolerance=1)
>>> folder = tempfile.TemporaryDirectory()
>>> path = Path(folder.name) / "stand.nc"
>>> linear = tc.Method(resolution="linearized")
>>> tc.run(stand, samples=200, seed=1, method=linear, out=path, surfaces=16).close()

## Layout

Each realization is one row and carries its own certificate.

| variable | dimensions | meaning |
|---|---|---|
| `measured` | realization, state, measure | values of the measures |
| `translation`, `rotation` | realization, state, part, axis (, body_axis) | t and R of x = R x0 + t |
| `gap_min` | realization, state, pair | smallest gap of each pair, with `coordinate_error`; negative is penetration |
| `active` | realization, pair | contact points that penetrate in the raw state |
| `carrying`, `reaction` | realization, pair | contact points under load, and the sum of their reactions |
| `status` | realization | see `tolcontact.contact` |
| `kkt_residual` | realization | residual of the optimality conditions [mm] |
| `iterations`, `starts` | realization | number of linear steps, and number of starts |
| `second_answers` | realization | QPs that another solver had to answer |
| `searched` | realization | 1 if contact points were projected again |
| `clashes` | realization | pairs of parts without declared contact that lie in each other, corrected; -1: not tested |
| `clash_part`, `clash_other` | realization | indices of the parts of the deepest of these pairs; -1: none |
| `clash_depth` | realization | how deep these lie in each other [mm]; NaN: not measured |

An exact resolution tests the bodies of all parts, whether their contact is declared or not, by a test that is complete: no two
lie in each other deeper than the attribute `interference_depth` [mm] where `clashes` is 0 and the realization is certified.
The attribute `not_watched` names what the test leaves out: parts that are not closed, contact pairs that give way or have
form, overlaps that are declared, and round faces of a contact pair, which are judged by their gaps. Where `clashes` is 0 and
`clash_part` is not -1, parts with declared contact lie in each other, and the realization is `doubtful`.
Linearized runs were not tested.

Where files round coordinates noticeably, the attribute `stored_coordinates` says to what, and what contact allows;
`coordinate_error` in the group `contact` states the amount for each pair [mm].

With stations `measure_station`, `pair_station` and `part_station` state what belongs to which; the pose of a part is
that in the last station that holds it, and the status is that of the worst station. Groups `station/<name>` hold the poses of
all its parts (`station_part`), `station_translation` and `station_rotation`, and `station_status`.

With contact that gives way `point_stiffness` in the group `contact` states the stiffness of each contact point. The
reaction of a two-sided locator is negative if it pulls.

`state` is raw or corrected. Groups hold the rest: `contact` the contact points, `sample` the contributors (locators, freedoms
of features, variables), with source, units, tolerance, rule and mean shift, and their drawn `deviation` (realization,
contributor), `field/<part>` the displacement fields, `surface` the check between contact points, `model` the declaration as
JSON, `statistics/<name>` what `tc.contributions`, `tc.sensitivities`, `tc.worst_case`, `tc.tails`, `tc.allocate`,
`tc.relocate` and `tc.seating` return with `into=`. A group has the name of its part, followed by an underscore if that is the
name of a dimension (the attribute `part` is the name in any case). Attributes state the format number, the versions, the seed,
the solver with its options, the method with all its choices, and the sampling plan (`sampler`); `method_from` states whether
the method was the model's, the defaults, or set by options.

## Reading it

>>> run = xr.open_datatree(path)
>>> run.measured.std("realization").round(2).values.ravel().tolist()  # raw, corrected
[0.17, 0.04]
>>> float((run.status == 1).mean())  # share of realizations that contact moved
0.88
>>> field = run["field/block"].six_sigma.sel(state="corrected", component="magnitude")

Gaps can be recomputed from poses and contact points, except where `searched` is 1, and of pairs whose `bounded` is 1: those
places are not archived. The gaps of a bounded pair are those of both bodies as they end, which poses and shapes determine
(`tolcontact.testing` finds them again).

>>> def gaps(run, state):
...     '''Gaps (realization, point) [mm].'''
...     contact, R, t = run["contact"], run.rotation.sel(state=state).values, run.translation.sel(state=state).values
...     moving, reference = (contact[name].values[contact.pair_of_point] for name in ("moving_part", "reference_part"))
...     x_m = np.einsum("kpij,pj->kpi", R[:, moving], contact.moving_point.values) + t[:, moving]
...     x_r = np.einsum("kpij,pj->kpi", R[:, reference], contact.reference_point.values) + t[:, reference]
...     n = np.einsum("kpij,pj->kpi", R[:, reference], contact.reference_normal.values)
...     return (n * (x_m - x_r)).sum(axis=2)
>>> bool(np.allclose(gaps(run, "raw").min(axis=1), run.gap_min.sel(state="raw", pair="interface")))
True
>>> run.close()

A `reference_part` of -1 is the ground, with R = I and t = 0. For a one-sided locator, subtract the `deviation` of the locator
`locator_of_point`, unless it is -1 (a locator is the contributor with the same number).

Where a side of a pair is a feature (`face_of_moving`, `face_of_reference` not -1), displace its points in the part first: with
(tau, rho) = `face_twist` @ `deviation` a point p goes to centre + tau + exp([rho]x) (p - centre), `face_centre`, and normals
turn by exp([rho]x). Then subtract `face_height` @ `deviation` of the reference side, and that of the moving side times
`facing`. For a locator that stands against a feature (`face_of_locator`), add to its deviation the height there, less its
direction times the displacement; for one on a feature of another part (`ground_of_locator`), add its direction times the
displacement there.

A face with form (`form_covariance` not empty) stands higher at a point p by the sum over modes of the `deviation` with number
`form_contributor` times (f(p) - `form_removed` @ [1, n, p x n]), where n is the unit normal of the surface `form_surface_...`
at p, away from its axis or centre, and f(p) = covariance(p, `station`) @ `station_weight` with the stations of that face
(`face_of_station`). The covariances of a distance r are exp(-r^2 / 2); with s = sqrt(5) r, (1 + s + s^2 / 3) exp(-s); and with
s = sqrt(3) r, (1 + s) exp(-s). The distance counts in `form_length` across the axis of the surface, in `form_length_along`
along it; with a number of `form_lobes` it is the one along the axis alone, and a cosine of that multiple of the angle around
the axis is a factor. If a form is measured from the "circles" of sections (`form_associated`), f is without its first harmonic
and its mean around the axis; from "lines", without its line of least squares between `form_start` and `form_end`. Subtract the
heights of both sides from gaps, at their nominal points, that of the moving side times `facing`; add that of the face of a
locator to its deviation. `tolcontact.testing.assert_gaps_recompute` does all of this from the file alone.

The deviations of a datum of a face with form, `tangent_face`, are the offset and the tilts (`tangent_contributor`) of the plane
that touches heights of this face at the places `tangent_place_at`: `tangent_height` @ `tangent_leaning` @ `deviation`, and the
form. It is none of these below any height, and the largest distance is least, of all planes with coordinates in the span of
`tangent_free`. `tolcontact.testing.assert_datums_recompute` finds these planes again.

`tc.open_archive(path)` checks everything but the rows and opens the file; `tc.model_of` rebuilds its model.

>>> with tc.open_archive(path) as results:
...     print(tc.model_of(results).parts)
(part table: box 100 x 50 x 10 mm, fixed, part block: box 50 x 25 x 10 mm at (50, 12.5, 10))

Runs of one model with different seeds form one sample: xarray reads the rows of several archives lazily as one dataset.

>>> other = path.with_name("other.nc")
>>> tc.run(stand, samples=200, seed=2, method=linear, out=other, surfaces=16).close()
>>> once = {"data_vars": "minimal", "coords": "minimal", "compat": "override"}
>>> rows = {"combine": "nested", "concat_dim": "realization", "drop_variables": ["row_checksum", "summed_rows"], **once}
>>> with xr.open_mfdataset([path, other], **rows) as both:
...     both.sizes["realization"], both.measured.std("realization").round(2).values.ravel().tolist()
(400, [0.17, 0.05])

## Size

`keep` states which variables of each realization are archived: "measures" (with gaps, statuses and residuals; 75 bytes for
RA1, or 75 MB per million), "poses" (also the poses), or "all" (default: also the deviations). A run that does not fit on the
disk is refused before the first byte.

## Stopping and resuming

An archive is not overwritten unless you ask for it (`overwrite=True`, `--overwrite`). A run reserves its archive from the
start: a second run that would write to it is refused.

From its first block on, a run may be stopped or killed at any moment. The file can then be opened and holds the finished rows;
other rows have the status -1 (`unfinished`). The summary states how many rows are finished, and the fields cover those up to a
recent one. (This covers a killed process. Writes are not flushed to the physical disk, so a power failure may lose more.)
`resume=True`, `--resume` continues the run and gives the same data as an uninterrupted run, up to the original number of
realizations or `samples`, whichever is larger.

>>> with tc.run(stand, samples=300, seed=1, method=linear, out=path, surfaces=16, resume=True) as results:
...     print(results.sizes["realization"], results.attrs["history"])
300 ... created
... resumed after 0 realizations

A resumed run starts after the last checkpoint, here after none. The model, its contact points, the solver and the method must
be the same as before; otherwise the run is refused.

## Checksums and untrusted archives

CRC-32 checksums cover the variables that are written once, each field, and every block of realizations. They are verified when
an archive is read: `tc.open_archive` checks all but the rows, `tc.summarize` the rows. A damaged archive is refused with a
one-line message. Checksums detect damage, not forgery.

Before anything in an archive is trusted, a separate process with a limit on time and memory inspects it. Its model is data:
nothing in it is executed, and a distribution is rebuilt only if its name is that of a continuous one in `scipy.stats` and its
arguments are numbers.

>>> folder.cleanup()
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
