"""The equations: poses, gaps, the contact QP, and the objectives of the corrected pose. A chapter of the guide.

Numbers in parentheses are equation numbers of the method paper (Sadeghi Tabar, Lindkvist, Wärmefjord, Söderberg, *Variation
Simulation of Rigid Bodies with Contact Representation*). Each equation is written once, as a CasADi expression, in a file of
this package. The rows of the QP come from the derivatives of these expressions.

## Poses

The pose X = (R, t) moves a point from its nominal position x0 in the assembly frame to x = R x0 + t (1). The nominal pose is
the identity. In the *raw* state, parts are where their locators put them. In the *corrected* state, contact has been resolved.

A locator is a point p, a unit direction n into the part, and a deviation d. With c the centroid of the locators, the rows
[n', ((p - c) x n)'] form the locator matrix J, and

    (delta, theta) = J^-1 d        R = exp([theta]x)        t = c + delta - R c

If there are more than six locators, the two-sided ones are satisfied exactly, and the one-sided ones in the least-squares
sense. A part that is located on another part follows its raw pose. If a locator rests on a feature, the height of the feature
at that point is added to the deviation d. If a floating part has fewer than six locators, q is the least motion that meets
them, with rotations scaled by the part's size.

## Gaps

The gap of a contact point is (2) to (5)

    g = n . (x_m - x_r)        x_m = R_m P_m + t_m        x_r = R_r P_r + t_r        n = R_r n_r

It is negative if the moving point lies inside the reference part. The face of a feature has a small pose in its part, to first
order p -> p + tau + rho x (p - centre), with tau and rho linear in the deviations. This pose is composed into the relative
pose, so it adds no rows. A variation of size is subtracted from the gap, or added to the radius of a ball or shaft.
The gap is affine in the relative pose X_RM. All gaps of a pair are therefore one product of 13 numbers with a constant matrix.
A one-sided locator is a contact point against the part that it locates on, or the ground, raised by its deviation.

## The QP

The variables are the increments dq = (dt, w) of all parts that contact can move. For parts that contact couples, (9) to (11) is

    minimize  1/2 dq' Q dq + f' dq     subject to     g_i + A_i dq >= 0

with a slack for each pair. The slack has an exact penalty: it stays zero unless rows contradict each other. The QP always has a
solution, and no realization is dropped. The paper's step ends with R <- (I + [w]x) R (12), which keeps the linearized gap
exactly, but stretches the part by the order of |w|^2. A part that supports other parts is rotated by exp([w]x) instead. The
exact resolution repeats steps with exp([w]x) until no true gap is negative and the objective is minimal.

>>> import numpy as np
>>> import tolcontact as tc
>>> stand = tc.Assembly("stand")
>>> table = stand.part("table", tc.Box(100, 50, 10), fixed=True)
>>> block = stand.part("block", tc.Box(50, 25, 10), at=(50, 12.5, 10))
>>> location = stand.locate(block, tc.three_two_one(block.face("-z"), block.face("-y"), block.face("-x")), tolerance=5)
>>> pair = stand.contact("interface", moving=block.face("-z"), reference=table.face("+z"))
>>> height = stand.measure("height", block.point(50, 0, 10), along="z")
>>> for resolution in ("linearized", "exact"):
...     results = tc.run(stand, samples=200, method={"resolution": resolution}, surfaces=0)
...     R = results.rotation.sel(part="block", state="corrected").values
...     print(resolution, bool(np.allclose(R @ R.swapaxes(1, 2), np.eye(3), atol=1e-9)))
linearized False
exact True

## Objectives

`tc.Method(objective=...)` names the quantity that the corrected pose minimizes. Displacements of points and springs are
measured from the raw state.

| objective | minimizes |
|---|---|
| "all points" (default if exact) | 1/2 sum of squared displacements of all contact points |
| "active points" (default if linearized) | the same sum over the contact points that penetrated |
| "locator stiffness" | energy 1/2 sum k e^2 of the two-sided locators as springs |
| "seating" | potential energy of the declared forces and of springs, with other two-sided locators exact |

| objective | choose it if |
|---|---|
| "all points" | you have no other requirement: this also constrains parts that barely penetrate |
| "active points" | you compare with the paper |
| "locator stiffness" | parts are clamped to their locators |
| "seating" | parts are pressed onto supports and neighbours; reactions are in N |

The displacement of a ball is measured at its centre, as a sphere with its radius. The displacement of a shaft is measured at
the ends of its axis. A point on the face would let the ball or shaft roll aside at no cost. A round wall likewise counts by its
own centre, and a flat one by the contact point.

In the exact resolution each point is weighted by its share of the moving face's area, with the centre and the second moments of
that share. All points together are then equivalent to the face, independently of their number. In the linearized resolution
each point counts once, as in the paper (`weighting` in the archive).

The objective determines the result, so every archive states it. For "seating" a small multiple (1e-3) of the displacement of
all contact points keeps the problem convex. This term takes over part of the load: about 0.1 % times (travel / size of the
contact).

A one-sided locator with a `stiffness` k [N/mm] is a spring that only pushes. Each point of a contact pair with a `stiffness` is
such a spring, too, with the point's share of the area. A two-sided locator with a `stiffness` is two springs at its point: one
pushes and one pulls. With the reactions lambda [N] and C = 1/k, the objective of the QP has the additional term
1/2 lambda' C lambda, and the row is g + A dq + C lambda >= 0. So `gap_min` of such a pair is negative by the largest
compression, and a realization is resolved only if poses and reactions obey lambda = k max(0, -g). The small multiple is then
measured from the pose of the last step, and takes no load. Springs of a pair stay at their points of the moving face. They push
against the plane of the other face, even beyond the edge of that face. A load off the centre of a pad sinks and tilts a
machine:

>>> pads = tc.Assembly("pads", method=tc.Method(objective="seating"))
>>> floor = pads.part("floor", tc.Box(400, 300, 20), fixed=True)
>>> machine = pads.part("machine", tc.Box(200, 100, 50), at=(0, 0, 20))
>>> stops = [tc.Locator("B1", (20, 0, 0), "y"), tc.Locator("B2", (180, 0, 0), "y"), tc.Locator("C", (0, 50, 0), "x")]
>>> location = pads.locate(machine, stops, tolerance=1, floating=True)
>>> pad = pads.contact("pad", moving=machine.face("-z"), reference=floor.face("+z"), stiffness=5000)
>>> weight = pads.force("weight", at=machine.point(120, 50, 0), vector=(0, 0, -1000))
>>> for name, x in (("left", 0), ("right", 200)):
...     measure = pads.measure(name, machine.point(x, 50, 0), along="z")
>>> sunk = tc.run(pads, samples=8, fields="none", surfaces=0).measured.sel(state="corrected").mean("realization")
>>> [round(float(height), 3) for height in sunk]  # F/k, and F e (b/2) / (k b^2/12)
[-0.08, -0.32]

`regularization` fixes the degrees of freedom that the objective leaves open. "points" (default) adds `eta` = 1e-6 times the
squared displacements of all contact points, and does not depend on the position of the origin. "identity" is the paper's
eta I of (11), which mixes mm and rad and therefore depends on the origin. With the origin 1 m away, RA1's 6 sigma is 6 %
larger and a single realization differs by up to 29 mm. `active_set="closed"` (default) also constrains points that the
correction itself drives into contact; `"initial"` is the paper's choice: only the points that penetrate in the raw state.
"""

from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.gap import GapMap
from tolcontact.mechanics.groups import Group, curved_pairs
from tolcontact.mechanics.pose import ENTRIES

__all__ = ["ENTRIES", "MOMENTS", "GapMap", "Group", "curved_pairs"]
