"""The whole workflow in Python: run, build, check, compare, summarize, and methods of results. A chapter of the guide.

All these functions accept a model as an assembly, as the function that declares it, or as the path of its script.

>>> import tolcontact as tc
>>> def assembly():
...     stand = tc.Assembly("stand")
...     table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
...     block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
...     scheme = tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"))
...     stand.locate(block, scheme, tolerance=1)
...     stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
...     stand.measure("height", block.point(50, 0, 10), along="z", tolerance=1)
...     return stand

`tc.check` returns all faults of a model: an empty tuple if it can be built.

>>> tc.check(assembly)
()

`tc.run` simulates a model, and checks some realizations between contact points (`surfaces`, see `tolcontact.contact`). Without
`out` the results stay in memory. With `out="stand.nc"` they are written to an archive, and the returned tree reads from this
file: close the tree, or use it in a `with` statement.

>>> results = tc.run(assembly, samples=500, seed=1, surfaces=16)
>>> results.sizes["realization"], results.attrs["solver"], results.attrs["resolution"]
(500, 'qpoases', 'exact')

A `tc.Method` replaces the method of the model; a mapping replaces single choices. An option that would have no effect is
refused: a `tc.Program` already has its solver and method, and `resume` needs the name of an archive.

>>> linear = tc.run(assembly, samples=100, solver="daqp", method={"resolution": "linearized"}, surfaces=0)
>>> linear.attrs["method_from"]
'options'

`progress` is called with the number of finished realizations. Ctrl-C leaves an archive that can be read and resumed.

`tc.simulate` returns the realizations of `tc.run` as a lazy dataset (this needs the extra `dask`). Chunks are simulated only
when they are needed, by local threads or on the workers of a client of `dask.distributed`. `to_netcdf`, `to_zarr` and
computations of xarray therefore need memory for a few chunks only. You can also supply the deviations, for example measured
ones.

>>> lazy = tc.simulate(assembly, 100_000, solver="daqp")
>>> lazy.measured.dims, lazy.measured.chunksizes["realization"][0]
(('realization', 'state', 'measure'), 32768)
>>> lazy.measured.std("realization").sel(measure="height").round(2).values.tolist()  # raw, corrected
[0.17, 0.08]
>>> raised = 0 * lazy.deviation[:1] + 0.5  # all locators of the block, by 0.5 mm
>>> tc.simulate(assembly, raised).measured.sel(measure="height").round(6).values.tolist()
[[0.5, 0.5]]

`tc.study` combines designs (models, seeds and methods) in one lazy dataset along the dimension `design`.

>>> designs = tc.study({"stand": assembly}, 1000, seeds=[1, 2], methods=[{"resolution": "linearized"}, {"resolution": "exact"}])
>>> designs.design.values.tolist()[:2]
['stand, linearized, seed 1', 'stand, linearized, seed 2']
>>> spreads = designs.measured.sel(state="raw").std("realization")  # one graph, which workers may share
>>> bool((spreads.groupby("seed").std() < 1e-12).all())  # the raw state does not depend on how contact is resolved
True

`tc.compare` runs several solvers or methods on the same draws, and reports agreement, failures, residuals and time.
Differences are relative to the first solver or method, in the corrected state, over the realizations that both certified.

>>> comparison = tc.compare(assembly, ["daqp", "qpoases"], samples=200)
>>> float(comparison.pose_difference.sel(solver="qpoases", extent="largest")) < 1e-9  # [mm]
True

`methods=[{"resolution": "linearized"}, {"resolution": "exact"}]` compares methods in the same way.

`tc.compare_runs` compares existing runs, given as named results or archives, with different designs, tolerances or methods.
Every change has a 95 % interval. Runs with the same seed are compared realization by realization, which makes the intervals
narrow; other runs are compared as independent samples.

>>> comparison = tc.compare_runs({"exact": results, "linearized": linear})
>>> change = comparison.change.sel(run="linearized", change_of="shift of the mean")
>>> str(comparison.draws.sel(run="linearized").values), change.dims
('same', ('state', 'measure', 'interval'))

`tolcontact.analyses` has further analyses of a model.

Methods of results are under `results.tolcontact`, also for archives that were opened with xarray itself:

>>> results.tolcontact.summary().attrs["realizations"], results.tolcontact.field("block").sizes["component"]
(500, 4)
>>> str(results.tolcontact.realization(17).status_meaning.values)
'resolved'
>>> results.tolcontact.where_status("not_assemblable").sizes["realization"]
0

`results.tolcontact.plot` draws the pictures of `tolcontact.plot`.

`tc.summarize` returns the statistics of results, or of the archive at a path (see `tolcontact.statistics`).

A wrong model, option or path raises a `tc.TolcontactError` before anything is simulated or written. The attribute `faults` of
a `tc.ModelError` lists all faults of the model.

>>> tc.run(assembly, samples=500, method={"resolution": "precise"})
Traceback (most recent call last):
    ...
tolcontact.errors.OptionError: resolution is 'precise'; expected one of: linearized, exact
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
