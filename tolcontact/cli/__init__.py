"""The command line: `tolcontact`, or `python -m tolcontact`. A chapter of the guide.

    tolcontact new NAME                                        write a small model with comments as a starting point
    tolcontact check MODEL.py                                  list every fault of a model, without a run
    tolcontact check MODEL.py --view                           also open the page of `view`, with marked faults
    tolcontact run MODEL.py --samples 1000 --seed 1            simulate, and print the summary
    tolcontact run MODEL.py --out FILE.nc                      simulate into an archive
    tolcontact summary FILE.nc [--json | --csv]                print the summary of an archive
    tolcontact summary FILE.nc --limits                        only shares out of specification, and capability
    tolcontact report FILE.nc [--out FILE.html]                write a page with the assembly in 3D, and charts
    tolcontact compare MODEL.py --solvers daqp,qpoases         compare solvers on the same draws
    tolcontact compare MODEL.py --resolution linearized,exact  compare resolutions; --objective compares objectives
    tolcontact compare A.nc B.nc [--report FILE.html]          compare runs, from the same draws or not
    tolcontact contributions MODEL.py [--by part]              sources of the variance of each measurement
    tolcontact sensitivities MODEL.py                          slope of each measurement by each contributor
    tolcontact worst MODEL.py                                  extreme values of each measurement, and the deviations
    tolcontact tails MODEL.py                                  probabilities of rare violations of limits
    tolcontact allocate MODEL.py --require "gap: ppm 1000"     tolerance ranges at the lowest cost
    tolcontact relocate MODEL.py --locator top.A3 ...          best position of a locator
    tolcontact seating MODEL.py                                friction that can hold parts short of their seats
    tolcontact view MODEL.py | FILE.stp                        show an assembly or a file before a run
    tolcontact bodies FILE.stp                                 the product tree of a STEP file, with numbers and sizes
    tolcontact faces FILE.stp --body NAME                      the faces of a body: numbers, kinds, directions, radii, areas
    tolcontact pmi FILE.stp [--json | --csv | --script]        the tolerances, dimensions and datums that a STEP file states
    tolcontact --version

`tolcontact COMMAND --help` lists the options, with examples; `tolcontact --install-completion` enables completion in the
shell. A script with `tc.main(assembly)` under its main guard accepts the options of `run`. Results go to stdout; progress,
warnings and errors go to stderr: progress is a bar with rate and remaining time in a terminal, a line every ten seconds
elsewhere, and nothing with `--quiet`. Tables use the width of the terminal, and are never cut in files and pipes. `compare`
prints JSON with `--json`, and writes netCDF with `--out`.

| option of `run` | |
|---|---|
| `--samples`, `--seed` | number of realizations, 1000 by default; the same seed gives the same realizations |
| `--solver` | QP solver, see `tolcontact.compilation` |
| `--resolution`, `--objective` | replace the model's own choice, see `tolcontact.contact` and `tolcontact.mechanics` |
| `--out FILE.nc`, `--overwrite`, `--resume` | write, replace (any file), or continue an archive |
| `--plan` | the plan of the draws: `monte-carlo`, `latin hypercube` or `sobol`, see `tolcontact.variation` |
| `--until "gap: 6 sigma +-1 %"` | sample until this confidence interval is narrow enough; also `mean +-0.01`, `ppm +-20 %` |
| `--keep measures`, `poses` or `all` | variables of each realization in the archive |
| `--fields` | number of realizations for the magnitudes of displacement fields, or `some`, `all`, `none` |
| `--quiet` | no progress, no notices |
| `--report FILE.html` | also write the page of `report` |
| `--surfaces` | number of realizations checked between contact points, 64 by default |
| `--workers N`, `--scheduler ADDRESS` | simulate in worker processes, or on a dask scheduler, see `tolcontact.simulation` |
| `--title`, `--part-number`, `--author`, `--revision`, `--date`, `--company` | replace entries of the title block |

| exit code | meaning |
|---|---|
| 0 | done |
| 1 | done, but more than 0.1 % of the realizations are not resolved, or what `--until` or `--require` states is not met |
| 2 | invalid input: one message, nothing written |
| 130, 143 | stopped by Ctrl-C or SIGTERM (a second one ends it at once); finished realizations are in the archive |

>>> from typer.testing import CliRunner
>>> from tolcontact.cli.app import app
>>> result = CliRunner().invoke(app, ["--version"])
>>> result.stdout.startswith("tolcontact "), result.exit_code
(True, 0)
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
