"""Tolerance analysis of rigid assemblies: Monte-Carlo variation simulation with contact resolved.

You declare parts, how they are located and toleranced, which faces may touch, and what is measured. tolcontact draws
thousands of realizations, places every part, removes interpenetration by a convex QP in each realization, and reports every
measure with and without contact, each figure with a 95 % confidence interval. Lengths are in mm, angles in rad.

>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
>>> scheme = tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"), inset=5)
>>> location = stand.locate(block, scheme, tolerance=1)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> measure = stand.measure("corner height", block.point(50, 0, 10), along="z", tolerance=1)
>>> results = tc.run(stand, samples=1000, seed=1)
>>> results.measured.std("realization").sel(measure="corner height").round(2).values.tolist()  # raw, corrected
[0.21, 0.08]

## The guide

Each phase of a run is a package. Its chapter is the file of that name in `tolcontact/guide`: read them in this order.

| phase | chapter | subject |
|---|---|---|
| declare | `tolcontact.declaration` | parts, faces, locators, features, tolerances, contact pairs, forces, measures |
| read shapes | `tolcontact.geometry` | meshes, STEP files, faces and their surfaces |
| read tolerances | `tolcontact.pmi` | tolerances, dimensions and datums that a STEP file states |
| tolerances of a drawing | `tolcontact.features` | kinds of features and tolerances, datums |
| fasten | `tolcontact.fasteners` | bolts, screws, pins and dowels in holes of several parts |
| discretize | `tolcontact.discretization` | contact points, balls and shafts, warnings |
| draw | `tolcontact.variation` | distributions of deviations, zones of features, seeds |
| equations | `tolcontact.mechanics` | poses, gaps, the QP, what the corrected pose minimizes |
| interference | `tolcontact.interference` | whether bodies lie in each other, by a complete test |
| compile | `tolcontact.compilation` | QP solvers, their accuracy |
| nominal assembly | `tolcontact.plausibility` | warnings of what is probably a mistake |
| resolve contact | `tolcontact.contact` | linearized or exact resolution, statuses, what a certificate covers, limits |
| simulate | `tolcontact.simulation` | blocks, threads, reproducibility |
| summarize | `tolcontact.statistics` | estimates and their intervals, displacement fields |
| archive | `tolcontact.archive` | the netCDF file: layout, reading, resuming, checksums |
| report | `tolcontact.report` | tables, pages for a browser, notebooks |
| draw pictures | `tolcontact.plot` | histograms, fields and assemblies for papers and slides |
| whole flow in Python | `tolcontact.workflow` | `run`, `build`, `check`, `simulate`, `compare`, `summarize` |
| analyse | `tolcontact.analyses` | what matters, what is extreme or rare, which tolerances and positions suffice, what seats |
| whole flow in a shell | `tolcontact.cli` | the command `tolcontact`, its exit codes |

Every example in the guide is run by the tests.

## Names

| purpose | `tc.` |
|---|---|
| declare | `Assembly`, `Stack`, `Part`, `Box`, `Mesh`, `Pin`, `Locator`, `three_two_one`, `Tolerance`, |
| | `TitleBlock`, `degrees` |
| tolerance features | `Size`, `Position`, `Profile`, `LineProfile`, `Parallelism`, `Perpendicularity`, `Angularity`, |
| | `Symmetry`, `Coaxiality`, `CircularRunout`, `TotalRunout`, `Straightness`, `Flatness`, `Roundness`, `Cylindricity`; |
| | `Form`, `DatumTargets`, `Variable` |
| measure faces | `Gap`, `Flush`, `Clearance`, `LargestGap`, `MeanGap`, `AxisDistance`, `Angle`; |
| | `Minimum`, `Maximum`, `Mean`, `Sum`, `Difference`, `Chain`; `stations` |
| fasten | `fasten` |
| run | `main`, `run`, `build`, `check`, `compare`, `simulate`, `simulate_blocks`; `Method`, `Program` |
| read results | `open_archive`, `summarize`, `compare_runs`, `Status`, `plot` |
| errors and warnings | `TolcontactError` and its kinds `ModelError` and `OptionError`; `NominalWarning` |
| choose faces, `tc.select` | `Facing`, `Inside`, `Near`, `Brep`, `Cylinder`, `Largest` |
| analyse, `tc.analyses` | `stack_up`, `contributions`, `sensitivities`, `tails`, `worst_case`, `allocate`, `relocate`, |
| | `seating`, `sweep`, `Stopped` |
| read and write files, `tc.io` | `bodies_in`, `faces_in`, `parts_from`, `read_pmi`, `features_from_pmi`, `measured_planes`, |
| | `write_model`, `model_of` |
| test your models, `tc.testing` | `assert_resolved`, `assert_no_clashes`, `assert_gaps_recompute`, |
| | `assert_datums_recompute`, `assert_same_run` |

`tc.declaration` has the types of everything that a declaration returns, `tc.errors` all errors and warnings.
"""

from importlib import import_module
from importlib.util import find_spec
from typing import Any

import lazy_loader

from tolcontact.errors import nearest_name
from tolcontact.readable import Pictured


def _picture(thing: object) -> str:
    """Return an object as HTML. The formatter is imported when a notebook first asks for it."""
    return str(import_module("tolcontact.report.notebook").html_of(thing))


Pictured.picture = staticmethod(_picture)

_public_name, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
_MODULES = ("select", "analyses", "io", "testing", "declaration", "errors")


def __getattr__(name: str) -> Any:
    """Return a public name, which is imported when it is first asked for. Raises AttributeError, which says where it is."""
    try:
        return _public_name(name)
    except AttributeError:
        if name.startswith("_") or find_spec(f"{__name__}.{name}"):  # nobody's mistake: a module that is about to be imported
            raise
    places = [module for module in _MODULES if name in dir(_public_name(module))]
    where = f"; it is tc.{places[0]}.{name}" if places else nearest_name(name, __all__)
    raise AttributeError(f"tolcontact has no name {name}{where}")
