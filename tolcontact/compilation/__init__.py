"""Compilation of a model: its equations become functions, and its contact QP is built once. A chapter of the guide.

`tc.build(model, solver=..., method=...)` returns a `tc.Program`. `tc.run` and `tc.simulate_blocks` accept a program in place of
a model, so that a model is compiled once for many runs.

>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
>>> location = stand.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=1)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z")
>>> program = tc.build(stand, solver="daqp")
>>> first, second = (tc.run(program, samples=100, seed=seed, surfaces=0) for seed in (1, 2))

## Solvers

`solver` names any installed conic plugin of CasADi that solves a small test problem correctly, or `graph`, tolcontact's solver.

| solver | choose it if |
|---|---|
| `qpoases` (default) | you want the safe choice: correct on every problem of the study, two to three times slower than daqp |
| `daqp` | you want speed |
| `graph` | you want speed, above all with many bodies; it exploits the graph of bodies, and falls back to daqp where it fails |
| `osqp` | you compare with a first-order method; a hundred times slower on hard problems |
| `proxqp`, `highs`, `piqp` | you compare solvers |

Plugins that are known to return wrong results, or that cannot handle these problems, are refused by name, with the reason:
ipqp, superscs, fatrop, hpipm, qrqp, clp, cbc, nlpsol. The study in `studies/solvers` compares accuracy and time.

>>> tc.run(stand, samples=10, solver="superscs")
Traceback (most recent call last):
    ...
tolcontact.errors.OptionError: solver "superscs" is refused: it reports success with wrong answers; choose one of: ...

## Accuracy, for every solver

Each answer is judged by its KKT residual in mm, computed from the QP that was solved. An answer whose residual exceeds 1e-9 mm
is polished: the active set is solved as one linear system. (For steps below 1e-3 mm the limit is 1e-10 mm.) If the residual
then still exceeds 1e-8 mm, `qpoases` or `daqp` answers instead, and the archive counts it in `second_answers`.

Small steps seldom change the active set. So solvers that start from the previous problem (`qpoases`, `osqp` and `highs`) are
called only if the active set of the realization's previous step does not satisfy the KKT conditions within 1e-9 mm. They always
solve the first QP of a realization.

On 1000 realizations of RA1 the corrected poses of all these solvers agree with daqp to 2e-13 mm, except proxqp (6e-11 mm) and
piqp (3e-8 mm). 8 solutions for highs and 3 for piqp came from another solver.

>>> float(first.kkt_residual.max()) < 1e-8
True

Each QP covers the parts that contact couples: parts that touch no common free part have separate QPs. Rows are scaled to
length 1 and increments to mm, so that residuals and tolerances are lengths. Functions that are evaluated more than 10 000
times, in one process or several, are compiled to machine code, which gives the same results to the last bit as CasADi's
interpreter. The machine code is kept in the user's cache folder (`~/.cache/tolcontact` on Linux, 268 MB at most), so the next
process that simulates the same model need not compile it again. Kernels that Numba compiles are kept there, too, in a folder
for each version of their sources.

A group of few bodies has one function that assembles its QP, and one that judges the answer. With six or more coupled bodies, a
QP is assembled from elements. An element is a pair of faces with the parts that its increments move or, if forces press, a part
with its forces and two-sided locators. Elements of one kind share their functions, which take the constants of the element as
inputs. So thirty blocks in a tower are compiled as fast as six. Pairs are of one kind if they have equally many rows; pairs of
round faces must be equal. Both ways agree to 1e-11 mm. The regularization "identity" has no elements.
"""

from tolcontact.compilation.contact_rows import SLOTS
from tolcontact.compilation.functions import NamedFunction
from tolcontact.compilation.plugins import ACCURACY, usable_plugins
from tolcontact.compilation.program import ContactGroup, Program, compile_program

__all__ = ["ACCURACY", "SLOTS", "ContactGroup", "NamedFunction", "Program", "compile_program", "usable_plugins"]
