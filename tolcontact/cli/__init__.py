"""The command line: `tolcontact`, or `python -m tolcontact`. A chapter of the guide.

    tolcontact new NAME                                  write a small model with comments, to begin with
    tolcontact check MODEL.py                            list every fault of a model; run nothing
    tolcontact check MODEL.py --view                     also open the page of `view`, with faults marked
    tolcontact check MODEL.py --population 1000          draw features, and print how many are inside their zones
    tolcontact run MODEL.py --samples 1000 --seed 1      simulate, and print the summary
    tolcontact run MODEL.py --out FILE.nc                simulate into an archive
    tolcontact summary FILE.nc [--json | --csv]          print the summary of an archive
    tolcontact summary FILE.nc --limits                  only how measures keep within their limits
    tolcontact report FILE.nc [--out FILE.html]          write it as one page, with the assembly to turn, and charts
    tolcontact compare MODEL.py --solvers daqp,qpoases   solvers on the same draws
    tolcontact compare MODEL.py --resolution linearized,exact
    tolcontact contributions MODEL.py [--by part]        what the variance of each measure comes from, with contact and without
    tolcontact sensitivities MODEL.py                    how much each measure follows each contributor, through contact
    tolcontact worst MODEL.py                            the least and the largest value of each measure, and what gives it
    tolcontact tails MODEL.py                            how often measures are outside their limits, where that is rare
    tolcontact allocate MODEL.py --require "gap: ppm 1000"   ranges at least cost, and which to tighten first
    tolcontact relocate MODEL.py --locator top.A3 ...   where a locator makes a measure vary least
    tolcontact compare A.nc B.nc [--report FILE.html]    runs side by side, from the same draws or not
    tolcontact view MODEL.py | FILE.stp                  look at it before any run: faces with the words that choose them
    tolcontact bodies FILE.stp                           the product tree of a STEP file, with numbers and sizes
    tolcontact faces FILE.stp --body NAME                the faces of a body: numbers, kinds, directions, radii, areas
    tolcontact --version

`tolcontact COMMAND --help` lists the options, with examples; `tolcontact --install-completion` completes them in the shell. A
script with `tc.main(assembly)` under its main guard takes those of `run`. Results go to stdout; progress, warnings and errors
go to stderr: a bar with rate and time left in a terminal, elsewhere a line every ten seconds, nothing with `--quiet`. Tables
are as wide as the terminal lets them be, and never cut in files and pipes. `compare` prints JSON with `--json`, and writes
netCDF with `--out`.

| option of `run` | |
|---|---|
| `--samples`, `--seed` | number of realizations, 1000 by default; the same seed gives the same realizations |
| `--solver` | QP solver, see `tolcontact.compilation` |
| `--resolution`, `--objective` | replace the model's own choice, see `tolcontact.contact` and `tolcontact.mechanics` |
| `--out FILE.nc`, `--overwrite`, `--resume` | the archive: written, replaced, or continued |
| `--plan` | how contributors are drawn: `monte-carlo`, `latin hypercube` or `sobol`, see `tolcontact.variation` |
| `--until "gap: 6 sigma +-1 %"` | go on until the interval of a corrected measure is so narrow: `mean +-0.01`, `ppm +-20 %` |
| `--keep measures`, `poses` or `all` | what is archived of each realization |
| `--fields` | how many realizations the magnitudes of displacement fields cover: a number, `some`, `all` or `none` |
| `--quiet` | no progress, no notices |
| `--report FILE.html` | also write the page that `report` writes |
| `--surfaces` | how many realizations are checked between contact points, 64 by default |

| exit code | meaning |
|---|---|
| 0 | done |
| 1 | ran, but more than 0.1 % of the realizations are not converged, not assemblable, or doubtful |
| 2 | bad input: one message, nothing written |
| 130, 143 | stopped by Ctrl-C, or by a signal to terminate; what is finished is in the archive |

>>> from typer.testing import CliRunner
>>> from tolcontact.cli.app import app
>>> result = CliRunner().invoke(app, ["--version"])
>>> result.stdout.startswith("tolcontact "), result.exit_code
(True, 0)
"""

from tolcontact.cli import analyses, bodies, check, compare, faces, new, report, run, summary, view
from tolcontact.cli.app import command_line, main

__all__ = [
    "analyses", "bodies", "check", "command_line", "compare", "faces", "main", "new", "report", "run", "summary", "view",
]  # fmt: skip
