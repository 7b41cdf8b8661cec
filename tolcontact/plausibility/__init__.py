"""Look at the nominal assembly as an experienced colleague would, and warn of probable mistakes. A chapter of the guide.

A model without faults may still not be the assembly that you mean. `tolcontact check`, `tolcontact run`, the analyses and
`tc.build` issue a `tc.NominalWarning` for everything below. Each one names the declaration with the line of the script, states
the number, and says what probably caused it. Nothing is changed, and the run continues.

>>> import warnings
>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(20, 12.5, 5))
>>> scheme = tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x"))
>>> location = stand.locate(block, scheme, tolerance=0.2)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z", limits=(14.5, 15.5))
>>> with warnings.catch_warnings(record=True) as caught:
...     program = tc.build(stand)
>>> for warning in caught:
...     print(warning.message)
[overlap] contact pair "interface" (...): its faces overlap by 5 mm in the nominal assembly, far beyond what varies there ...
[limits] measurement "height" (...): its nominal value 0 is outside of its limits (14.5 to 15.5 mm); it measures the
displacement from the nominal place; absolute=True measures the coordinate

| kind | what is looked at |
|---|---|
| `[units]` | mesh files without stated units: of an implausible size (below 1 mm, above 10 m, ten times that of a part that |
| | they touch), or on which all declared points would lie in another unit |
| `[face]` | faces of a file that are a part of a cylinder, or of another curved surface: files split holes into halves |
| `[coarse]` | contact points or triangles of curved faces that are coarse beside the smallest tolerance |
| `[angle]` | rotations beyond a full turn, or beyond half a turn in whole numbers: these are probably degrees |
| `[point]` | points of locators, measurements and forces that lie off their part by more than a quarter of its size |
| `[direction]` | locators whose directions all fit in the assembly frame alone; one-sided ones that point out of their part |
| `[tolerance]` | zones wider than half of their part; locators that turn their part by more than 45 degrees at three sigma |
| `[overlap]` | faces of a contact pair, or bodies that are no pair, that lie in each other |
| `[clash]` | bodies that tolerances put into each other, though no contact is declared that holds them apart there |
| `[gap]` | faces of a contact pair that are too far apart to touch |
| `[limits]` | limits that exclude the nominal value, or that are more than 100 sigma away from it |
| `[reach]` | clearances by triangles whose faces move so far that other triangles may be nearer |
| `[friction]` | seats that forces may not push their part onto, at the stated coefficients of friction (see `tc.seating`) |
| `[form]` | measured faces that lie in no zone as wide as the tolerance of form that is stated |

The faces of a pair overlap if their deepest point stays inside in nearly every realization without contact: the median of its
gap is more than three sigma below 0. They are too far apart if the smallest gap exceeds 30 sigma and the distance by which
other contact may push them. Both come from 128 draws without contact. With the objective "seating" forces close gaps, so none
is too large. The overlap of two bodies is the diameter of the largest ball that lies in both; it counts from a fiftieth of the
thinner body on, and beyond the height of round faces over their triangles. Bodies that are not closed are left out, and so is
an overlap at the wall of a hole in which one of the bodies is located: screws are thicker than their threads.

## Clashes

Contact acts between faces that are declared. A block that is located 0.05 mm from a wall may lie in it in every third
realization, and nothing pushes it out: what is measured there is not what would be measured. Bodies of the 128 draws are
tested by their triangles, which is complete, and those that contact may move are resolved before. A pair counts from a depth
of 1/1000 of the smallest tolerance on, and if it does not lie in each other nominally. The warning names the faces that meet.

>>> nook = tc.Assembly("nook")
>>> table = nook.part("table", tc.Box(100, 50, 10), fixed=True)
>>> wall = nook.part("wall", tc.Box(10, 50, 40), at=(-10, 0, 10), fixed=True)
>>> block = nook.part("block", tc.Box(50, 25, 10), at=(0.05, 12.5, 10))
>>> location = nook.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("+x")), tolerance=0.6)
>>> pair = nook.contact("seat", moving=block.face("-z"), reference=table.face("+z"))
>>> height = nook.measure("height", block.point(50, 0, 10), along="z", tolerance=1)
>>> with warnings.catch_warnings(record=True) as caught:
...     program = tc.build(nook)
>>> print(caught[0].message)
[clash] part "block" (...): it lies in part "wall" in ... % of 128 draws, up to ... mm, near (...), and no contact holds them
apart; declare it: assembly.contact("block on wall", moving=block.face("-x"), reference=wall.face("+x")), or say that it is
meant: assembly.may_overlap(wall, block)

Press fits, welds and parts that are modelled overlapping are meant: `may_overlap(part, part, ...)` says so of any two of its
parts. Neither a check nor a run watches these bodies, and a contact pair between them holds for its chosen faces alone.

>>> nook.may_overlap(wall, block)
overlap of wall, block
>>> with warnings.catch_warnings(record=True) as caught:
...     program = tc.build(nook)
>>> caught
[]

Two bodies whose contact is declared may still meet beyond the chosen faces: the block on one leg of an L, against its other
one. An exact resolution does not certify such realizations (they are `doubtful`), and the warning names the faces to add.
A run counts realizations with clashes, and its summary states their share (see
`tolcontact.archive`).

## Silence

A warning that describes what you mean is silenced by its kind and its name, with Python's own filter, in the script:

>>> with warnings.catch_warnings(record=True) as caught:
...     warnings.filterwarnings("ignore", r"\\[overlap\\] contact pair .interface.", tc.NominalWarning)
...     program = tc.build(stand)
>>> [str(warning.message)[:8] for warning in caught]
['[limits]']

In a shell, `PYTHONWARNINGS="ignore:[overlap]" tolcontact run model.py` silences a kind for one command.
"""

from tolcontact.plausibility.nominal_check import KINDS, warn_of_nominal

__all__ = ["KINDS", "warn_of_nominal"]
