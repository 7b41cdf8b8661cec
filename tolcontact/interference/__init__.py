"""Interference: whether closed bodies lie in each other, by a complete test. A chapter of the guide.

>>> import numpy as np
>>> import trimesh
>>> from tolcontact.interference import Neighbours, deviating_solid, solid
>>> from tolcontact.poses import AT_REST
>>> beam, post = trimesh.creation.box((40, 2, 2)), trimesh.creation.box((2, 40, 2))
>>> bodies = [deviating_solid(solid(body), [], np.zeros(12)) for body in (beam, post)]
>>> Neighbours(*bodies, insets=(1e-4, 2e-4), reach=1.0).interfere(AT_REST[None]).tolist()
[True]

The search for contact knows a list of places at which two bodies may touch. A certificate must not depend on that list: what
the list lacks, the search does not see. This test knows triangles alone.

## What decides

*Two closed polyhedra whose surfaces are in general position share interior points if and only if an edge of one passes
through a triangle of the other, or a connected component of one lies inside the other.* Let U be a component of the common
interior. It is bounded by planes of both bodies. If one body bounds it alone, a component of that body lies inside the other
one. Otherwise a facet of A and a facet of B meet on its boundary, along a segment that ends, since facets are bounded: at an
edge of A that passes through the facet of B, or the other way round. Conversely, bodies share interior points wherever an
edge of one passes through the surface of the other. Only edges between different planes count: diagonals of a flat facet
bound nothing.

*Not in general position* are bodies that touch, and bodies with flush faces: equal bodies, slabs in bars of the same section,
two bars of the same height that cross (above: no edge enters the other bar's interior, and they share a cube). Therefore both
bodies are first made smaller, by different amounts a and b: all planes move inwards, and each vertex stays on the planes that
meet in it. Then bodies that touch are a + b apart, and faces that were flush are not: the body that was made smaller by less
sticks out. Surfaces are in general position again unless bodies are exactly a + b or |a - b| apart, which no drawing asks
for.

Hence bodies of which the test says nothing share no ball with a radius of more than about (a + b) / 2. (A ball between two
planes of a wedge or a corner may be up to 1.7 times as large, since vertices of a reflex edge move farther than planes.)
Bodies that lie in each other by less than a + b count as touching: a + b is a thousandth of the smallest tolerance range, or
three times the error of fixed planes where a pair keeps its contact points (see tolcontact.contact).

## What is covered

- Closed bodies, as their triangles. A body that is not closed has no inside and is not tested. One that touches itself, along
  an edge or in a corner, is closed. Around such a corner planes may exclude each other, so that no vertex lies inside all of
  them: such bodies may count as in each other nominally where they only touch.
- Faces of features move as they vary, with vertices on the planes where they meet; at an edge of two such faces the body ends
  where both planes meet. Forms are not part of a solid: planes with form are compared at the minima of
  their gap instead (see tolcontact.contact), round faces with form on their surfaces.
- Triangles of round faces stand in the hollow of a bore, and inside a shaft. The first are moved out of the hollow; what lies
  between the triangles of a shaft and its surface is covered by the gaps of round faces, and checked on surfaces. So are two
  round faces of one contact pair, a pin in its bore: their triangles are not compared with each other.
- Bodies whose files round coordinates are smaller by that error from the outset, with flat planes (see `tolcontact.geometry`).
- A body that passed through another one and is on its far side is apart.
- Springs let faces into each other; such pairs are not tested.

## What follows

With `search="bounded"`, the default, every realization is tested in its corrected state. Bodies of a contact pair that lie in
each other make the realization `doubtful`: it is tried again, with a row along the direction in which the region that both
bodies share is narrowest, and certified only if the test passes then. Parts without declared contact that lie in each other
do not change a status, since nothing holds them apart: the archive counts them in `clashes`. Parts that lie in each other
nominally are left out, of that count and, unless their places of contact are found at every pose, of certificates; the
attribute `not_watched` of an archive names them.

## What it costs

Boxes decide first which bodies are near. Of these, many pairs are settled by a certificate: if one body lies in a convex region
that the surface of the other one does not reach, both are apart. The region is found once, in the nominal assembly, from
half-spaces and the hollow of a bore or a slot: a part on a table, a pin in its hole. In every realization it is as large as the
deviating faces of the outer body leave it, and the vertices of the inner body are compared with it (see
`tolcontact.interference.free_region`). A certificate is a proof, so that answers are the same without it. Small bodies, and
bodies without such a region, such as a bolt with its head or bodies that hook into each other, take the complete test. Of an
edge, only facets count that are nominally no farther away than the bodies have moved against each other."""

from tolcontact.interference.deviating_solid import DeviatingSolid, deviating_solid
from tolcontact.interference.neighbours import Interference, Neighbours, WayOut
from tolcontact.interference.solid import Solid, solid
from tolcontact.interference.watch import Clash, Watch, ordered

__all__ = [
    "Clash", "DeviatingSolid", "Interference", "Neighbours", "Solid", "Watch", "WayOut", "deviating_solid", "ordered", "solid",
]  # fmt: skip
