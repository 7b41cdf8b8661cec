"""Resolve contact: linearized or exact, starts and search, statuses, what a certificate covers, limits. A chapter of the guide.

>>> import trimesh
>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
>>> location = stand.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=1)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z")

## Linearized or exact

`resolution="exact"` (default) repeats linear steps about the true pose, with proper rotations, until every true gap of the
bodies is open and the objective is minimal. It usually takes 3 to 8 steps. Where faces end within reach of contact (see below)
it takes 3 to 12 times as long as the single linear step, the more where two outlines have many corners: 0.025 ms a realization
for the README's blocks, 0.5 ms for RA2, 0.7 ms for nine blocks in a row. With fixed points it takes one to three times as long
as the single step. By default it minimizes the displacements of all contact points, which count by the areas that they
stand for; the single step minimizes those of the active points, each of which counts once, as in the paper. If an option
replaces the resolution alone, the objective stays: `--resolution linearized --objective "active points"` is the paper's method.

`resolution="linearized"` is the paper's single linear step, about contact points and planes that are fixed in the nominal
state. If one plane meets one plane, this step opens all gaps with nearly the smallest motion. With several free bodies, or
with curved or opposed faces, it leaves penetration, which the summary reports; above 1 % of the smallest tolerance range the
summary recommends `exact`. The single step fails for a U in a U without clearance; `exact` resolves all of 10 000 draws of it
(see `studies/exact`).

>>> exact = tc.run(stand, samples=200)
>>> sorted({tc.Status(int(status)).name for status in exact.status})
['RESOLVED', 'UNTOUCHED']
>>> float(exact.gap_min.sel(state="corrected").min()) > -1e-8
True

The exact resolution first takes steps like the paper's. Realizations that have not converged after eight steps continue with
Newton steps, which take the curvature of the gaps and the objective into account. They stop when none of
twenty steps in a row is smaller than all before, or, if parts contradict each other, when ten steps do not reduce the
penetration. If there is a conflict, no solution, or a solution far from the raw pose, other starts are tried: from the nominal
pose, with small steps, or with contact points that are projected again. If a sampled round face has no solution, steps from
the raw pose first end where they are rounding, since rounding may grow from there: a shaft whose spin nothing holds would fall
through planes at fixed points. If two starts end in the same conflict, there is no third. The best solution is kept; `starts`
counts the starts.

Where faces end (see below), steps may go to and fro between two sets of places, or ask for contradictory ones, though bodies
come free if one is lifted a little. More starts are tried then. Convex bodies are held apart only along the direction in
which they part best. All others are first moved apart, each time along the direction in which what they share is narrowest,
until they lie in each other nowhere; steps from there are halved until they neither enter each other nor raise the objective.
In solutions from such a start, places more than 0.001 mm deep are on the far side of a body and do not count; that bodies are
apart is known from the complete test alone (see `tolcontact.interference`).

## Contact search

With `search="fixed"` contact points are projected once, in the nominal state; `search="iterated"` projects them again at the
corrected pose until they no longer move (paper, 2.2). It matters if curved surfaces slide along each other: for two rollers of
radius 10, one set down 3 mm beside the top of the other, the axes end 20 mm apart as they must (to 0.002 mm of the mesh), and
up to 0.5 mm too far apart with fixed points. If fixed points let a round part sink into its counterpart (a roller that spins),
the exact resolution notices and searches again for these realizations, which then take about 0.2 s each; the archive marks
them in `searched`. Balls and shafts beside walls need no search: their contact is computed at every pose (see
`tolcontact.discretization`).

## Where faces end

Fixed contact points are held outside the plane of their foot, even where that face has ended: a plate that slides clear of a
chamfered block may be held by the plane of the chamfer, and a pointed tip of the reference side may sink in between points of
the moving side. The exact resolution therefore resolves contact of the bodies as they end (`search="bounded"`). They touch
at a corner of one on a facet of the other, from both sides, or at an edge across an edge. Planes that face each other touch
at the corners of their overlap. These places are found at every pose, and a place counts only while it lies on both bodies.

When the model is compiled, 1024 raw poses decide for each pair: if fixed planes miss the depth of contact by no more than a
two-thousandth of the smallest tolerance range, the pair keeps its fixed points and costs no more than with them (`tolcontact
check` says which pairs do, and so do `bounded` and `plane_error` in the archive). Balls and shafts beside walls are exact
anyway.

>>> plate, wedge = tc.Box(60, 50, 3), tc.Mesh(trimesh.creation.cone(8, 6, sections=24))
>>> tip = tc.Assembly("tip")
>>> cone = tip.part("cone", wedge, fixed=True)
>>> cover = tip.part("cover", plate, at=(-30, -25, 6))
>>> rows = tc.three_two_one(cover.face("-z"), cover.face("-y"), cover.face("-x"), inset=2)
>>> location, pair = tip.locate(cover, rows, tolerance=1), tip.contact("seat", moving=cover.face("-z"), reference=cone.face())
>>> middle = tip.measure("middle", cover.point(30, 25, 0), along="z", tolerance=1)
>>> run = tc.run(tip, samples=100)
>>> bool((run.gap_min.sel(state="corrected") > -1e-8).all()), run["contact"].bounded.values.tolist()
(True, [1])

Bodies whose files round coordinates are smaller by that error (see `tolcontact.geometry`), so that they fit as drawn.

`studies/certificates` judges certified realizations of random bodies by exact distances of polyhedra. Limits: triangles are the
body, also where they stand for a curved face that is not known analytically. A pair of more than 100 000 places keeps its fixed
points, with a warning. The objective still weighs the sampled contact points. Places are looked for within twice the largest
travel of the 1024 raw poses, and as far as contact may push; for poses beyond, they are looked for again, farther away. Which
pairs keep their fixed points is decided by the tolerances: deviations that you supply, far beyond these, do not change that.

A part that contact barely holds may turn far at little cost: a plate over a tip, if only the points there count. Unless forces
turn it, a turn of more than twice that which moves the ends of the face as far as contact may push is not certified: the
realization is `doubtful`.

## Statuses

| status | number | meaning |
|---|---|---|
| `untouched` | 0 | no contact point penetrates: the corrected state is the raw state |
| `resolved` | 1 | contact moved parts, and the optimality conditions hold |
| `not_converged` | 2 | the conditions do not hold, or one linear step cannot open all gaps |
| `not_assemblable` | 3 | no pose without penetration was found near the raw one; the pose of least penetration is kept |
| `doubtful` | 4 | the conditions hold, but far from the raw pose, so the solution is not certified |
| `unfinished` | -1 | not simulated yet (in the archive of a stopped run) |

No realization is dropped: a failed one is a row with its status, and its last pose is included in the statistics.

## What a certificate covers

`untouched` and `resolved` are certificates. They state that the optimality conditions hold to 1e-8 mm at a pose *near* the raw
one and, in an exact resolution, that no contact point has a gap below 0 by more than that. Gaps count larger by the error of
coordinates in files, `coordinate_error` in the archive, if any. With `search="bounded"` they also state that the bodies of no
contact pair lie in each other by more than a thousandth of the smallest tolerance range, by a test that does not know the list
of contact points (see `tolcontact.interference`). The test looks at every realization. Where it contradicts the search, the
realization is tried again; if that does not help, it is `doubtful`. The penetration that a linearized resolution leaves is in
`gap_min`. "Near" means that no part turned by more than `near_turn` (1 rad), and no contact point moved by more than
`near_travel` (half the size of the largest part). A longer travel is accepted if the faces themselves lie under the points that
carry load, and penetrate each other by no more than 1 % of the smallest tolerance range (or 1e-4 sizes, if that is less) plus
the error of their triangles. For other solutions far from the raw pose, other starts are tried; if these do not help, the
realization is `doubtful`.

Two planes with form, or a body on a plane with form, touch at minima of their gap. Newton steps find these between contact
points at every pose, inside of the faces and along their rims, and each that is deeper than 1 / 2500 of the smallest tolerance
range gets a row. An answer with a minimum deeper than a thousandth of the range is `doubtful`. The search assumes that contact
points resolve the form: each minimum lies near a contact point that is nearly as deep. Where facets of a body reach the plane
at several heights, answers are compared at some thousand points instead. Round faces with form are checked at contact points
and on the surfaces alone.

Where faces end, a certificate covers both bodies as their triangles, and faces under load touch. Only if steps come to no rest
otherwise, a place that carries may lie beside its edge, as far as its plane errs there by a two-thousandth of the smallest
tolerance range. Where contact points are fixed, or projected again, a certificate does not cover the surfaces *between* them.
After the run, 64 certified realizations (`surfaces=`, `--surfaces`) are checked on the surfaces, at a much denser set of
points and in both directions. One third are those that penetrate most, one third those with most points under load, and the
rest are random. The check looks both ways: for penetration that contact points do not see, and, where points are fixed, for
contact that was resolved while the surfaces were apart. The summary states the largest depths, shares with their intervals
(from the random realizations), and how many touching points stand on a plane whose face has ended; above 1 % of the smallest
tolerance range a `tc.ContactWarning` names the pair and the remedy. The group `surface` of the archive states the realizations
and pairs that were checked. One-sided locators are points, so they are not part of this check. The study in
`studies/certificates` looks for a counterexample in a million realizations.

>>> float(exact["surface"].surface_penetration.max()) < 1e-6
True

## Limits

- There is no friction (see `tc.seating`). General surfaces have no form; they shift and tilt. With fixed points, gaps are
  correct only to first order between faces that tilt and touch outside their nominal overlap; so are those of round faces with
  sampled points that change in size. The pose is a local optimum, found step by step from the raw pose. On 1000 realizations
  of five models ipopt, also started from the raw pose, found no lower one. In a chain of bodies with degrees of freedom that
  barely anything holds, another optimum may lie a few mm away with an objective that differs in the fifth digit; a round part
  of flat triangles has one optimum on each triangle. Other starts are tried only if the first start leads to a conflict, no
  solution, or one far from the raw pose.
- Linearized, or with `search="fixed"`, contact points and planes are those of the nominal state, and planes do not end.
  If rims of faces shift against each other *and* tilt, their edges may
  penetrate deeper than the points, by about shift times tilt; the check of `surfaces` measures this.
- A ball or shaft keeps its nominal wall: the ends of a hole or a groove are not searched for again as it moves along. A hole
  whose rim is not square to its axis, a shaft across another one, and two shafts side by side have sampled points. The
  contacts of balls and shafts are always constrained, also with `active_set="initial"`.
- With stations contact is resolved station by station, and never again: a joint is rigid from then on, and penetration that a
  station left is handed on. The accuracy of a measure counts contact of its own station alone.
- "linearized" neglects second-order rotation, and stretches parts by that; a joint keeps the nearest rigid poses. Rows that
  contradict each other (a tab wider than its slot) end as `not_converged`, as does a step that fails; only "exact" tells the
  two apart.
- `not_assemblable` means that no pose without penetration was found near the raw one, not that none exists.
- A degree of freedom that no active point holds is determined by the regularization alone, and its motion may be large: with
  "active points", a part in a chain that barely penetrates can tilt or slide freely, and is then often `doubtful`. The other
  objectives hold it.
- "locator stiffness": springs softer than about 1e-4 of the stiffest act as if they were stiffer, because the regularization
  is scaled with the sum.
- "seating": reactions fall short by about 0.1 % times (travel / size of the contact). A part that finds no equilibrium within
  ten times its size ends as `not_converged`.
- The number of points under load is not unique if several points of a plane share a load, nor is the load shared by redundant
  pairs."""

from tolcontact.contact.resolver import ContactResolver
from tolcontact.contact.state import Resolved

__all__ = ["ContactResolver", "Resolved"]
