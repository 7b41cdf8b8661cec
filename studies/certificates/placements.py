"""Assemblies of stacks: disturbed, turned, moved away from the origin, located with tolerances, and paired in either order."""

import itertools
import zlib
from dataclasses import dataclass, replace

import manifold3d
import numpy as np
import trimesh
from scipy.spatial.transform import Rotation

import tolcontact as tc
from studies.certificates.loose_stacks import LOOSE
from studies.certificates.mating_stacks import MATING
from studies.certificates.polyhedra import Body, Polyhedron, ball_of_pairs, separation_of_pairs
from studies.certificates.stacks import HEIGHT, Pieces, Stack

FAMILIES = LOOSE | MATING
FEET = (((-8, -8, 0), "z"), ((8, -8, 0), "z"), ((0, 8, 0), "z"), ((-8, 0, 0), "y"), ((8, 0, 0), "y"), ((0, 0, 0), "x"))
REACH = 10.0  # mm
FLUSH = 1e-6  # mm: radius of a ball in two bodies that touch
TRIES = 30
STEEP = 0.3  # the largest vertical component of the normals of sides
Pairs = list[tuple[int, int]]


@dataclass
class Scene:
    """An assembly, its bodies in the nominal assembly, and the pairs that may touch.

    ranges    the tolerance ranges [mm] of locators along the stack, and across it
    up        the direction of the stack
    choices   a description of what was drawn
    """

    assembly: tc.Assembly
    bodies: list[Body]
    pairs: Pairs
    ranges: tuple[float, float]
    up: np.ndarray
    choices: str

    @property
    def tolerance(self) -> float:
        """The smallest tolerance range [mm]."""
        return min(self.ranges)

    @property
    def undeclared(self) -> Pairs:
        """The pairs of bodies without a contact pair that are not in each other nominally."""
        declared, count = {frozenset(pair) for pair in self.pairs}, len(self.bodies)
        at_rest = np.tile(np.concatenate([np.eye(3).ravel(), np.zeros(3)]), (1, count, 1))
        others = [pair for pair in itertools.combinations(range(count), 2) if frozenset(pair) not in declared]
        return [pair for pair in others if ball_of_pairs(self.bodies, [pair], at_rest, 0)[0] < FLUSH]


@dataclass
class Frame:
    """The rotation `turn` and the `shift` [mm] of a whole assembly; `is_baked` turns meshes, otherwise parts are turned."""

    turn: Rotation
    shift: np.ndarray
    is_baked: bool
    name: str

    @property
    def in_part(self) -> np.ndarray:
        """The rotation (3, 3) from the stack to the frames of parts."""
        return self.turn.as_matrix() if self.is_baked else np.eye(3)

    @property
    def rotation(self) -> np.ndarray:
        """The rotation vector [rad] of parts."""
        return np.zeros(3) if self.is_baked else self.turn.as_rotvec()


def surface_mesh(pieces: Pieces) -> trimesh.Trimesh:
    """Return the surface of a union of convex pieces, in double precision."""
    if len(pieces) == 1:
        return trimesh.convex.convex_hull(pieces[0])
    solids = [manifold3d.Manifold.hull_points(np.ascontiguousarray(points)) for points in pieces]
    surface = manifold3d.Manifold.batch_boolean(solids, manifold3d.OpType.Add).to_mesh64()
    return trimesh.Trimesh(surface.vert_properties[:, :3], surface.tri_verts, process=False)


def close_stack(family: str, tolerance: float, rng) -> Stack:
    """Return a stack of a family whose neighbours are within the tolerance of each other, as a rule."""
    for _ in range(TRIES):
        stack = FAMILIES[family](rng)
        bodies = [[Polyhedron(points) for points in pieces] for pieces in stack.bodies]
        at_rest = np.tile(np.concatenate([np.eye(3).ravel(), np.zeros(3)]), (1, len(bodies), 1))
        if all(separation_of_pairs(bodies, [pair], at_rest)[0] < tolerance for pair in stack.pairs[:2]):
            break
    return stack


def disturbed(stack: Stack, rng) -> tuple[list[Pieces], np.ndarray, str]:
    """Return the bodies of a stack as they are, or with noise of corners or places, a linear map (3, 3), and the choice.

    The map acts on unions of pieces, since faces that pieces share would come apart by rounding.
    """
    size = 10 ** rng.uniform(-2, 0)  # mm
    kind = str(rng.choice(["exact", "affine", "corners", "sideways", "places"], p=[0.5, 0.2, 0.1, 0.1, 0.1]))
    bodies, A = stack.bodies, np.eye(3)
    if kind == "exact":
        return bodies, A, kind
    if kind in ("corners", "sideways") and all(len(pieces) == 1 for pieces in bodies):
        along = np.array([1, 1, kind == "corners"])
        bodies = [[points + rng.normal(size=points.shape) * size * along] for (points,) in bodies]
    elif kind == "places":
        shifts = rng.normal(size=(len(bodies), 3)) * size * 0.3
        bodies = [[points + shift for points in pieces] for pieces, shift in zip(bodies, shifts, strict=True)]
    else:
        kind, A = "affine", A + rng.normal(size=(3, 3)) * size / 10
    return bodies, A, f"{kind} {size:.2g}"


def random_frame(rng) -> Frame:
    """Return a frame: often that of the stack itself, also by quarter turns, and far from the origin."""
    kind = str(rng.choice(["upright", "quarter turns", "turned"], p=[0.55, 0.12, 0.33]))
    quarters, turn = rng.integers(0, 4, 3) * 90, Rotation.identity()
    if kind == "turned":
        turn = Rotation.from_rotvec(rng.normal(size=3))
    elif kind == "quarter turns":
        turn = Rotation.from_matrix(np.round(Rotation.from_euler("xyz", quarters, degrees=True).as_matrix()))
    distance = float(rng.choice([0, 1e2, 1e4, 1e5], p=[0.7, 0.1, 0.1, 0.1]))
    is_baked = bool(rng.random() < 0.5)
    name = kind + (", baked" if is_baked else "") + (f", {distance:.0e} mm away" if distance else "")
    return Frame(turn, rng.normal(size=3) * distance, is_baked, name)


def locators(frame: Frame, tolerance: float, sideways: float, supports: bool) -> list[tc.Locator]:
    """Return six locators of a body: three from below, supports on request, two from the side, and one from the end."""
    axes = dict(zip("xyz", frame.in_part.T, strict=True))
    return [
        tc.Locator(
            f"L{k}",
            tuple(frame.in_part @ foot),
            tuple(axes[along]),
            tolerance if along == "z" else sideways,
            one_sided=supports and along == "z",
        )
        for k, (foot, along) in enumerate(FEET)
    ]


def declared_parts(assembly: tc.Assembly, bodies: list[Pieces], A: np.ndarray, frame: Frame, fixed: int) -> list[tc.Part]:
    """Return the parts of bodies, mapped by A (3, 3), in a frame; `fixed` is the index of the one that does not move."""
    parts = []
    for k, pieces in enumerate(bodies):
        origin = np.array([0, 0, HEIGHT * (k - 1)])
        surface = surface_mesh(pieces)
        surface.vertices = (surface.vertices @ A.T - origin) @ frame.in_part.T
        at = frame.turn.apply(origin) + frame.shift
        is_fixed = k == fixed
        parts.append(assembly.part(f"body {k}", tc.Mesh(surface), at=tuple(at), rotation=tuple(frame.rotation), fixed=is_fixed))
    return parts


def declare_contacts(assembly: tc.Assembly, parts: list[tc.Part], stack: Stack, frame: Frame, rng) -> str:
    """Declare the contact pairs of a stack, of whole surfaces or faces by normals, in either order; return the choices."""
    is_swapped, is_whole = rng.random() < 0.4, stack.undercut or rng.random() < 0.7
    points = None if rng.random() < 0.05 else int(rng.choice([20, 60, 100]))
    within = REACH if rng.random() < 0.3 else None
    z = frame.in_part[:, 2]
    below, above = ((), ()) if is_whole else ((lambda c, n: n @ z < STEEP,), (lambda c, n: n @ z > -STEEP,))
    for k, (upper, lower) in enumerate(stack.pairs):
        faces = parts[upper].face(*below), parts[lower].face(*above)
        moving, reference = faces[::-1] if is_swapped else faces
        reach = within if upper == lower + 1 else REACH  # the third body is no neighbour
        assembly.contact(f"joint {k}", moving=moving, reference=reference, points=points, within=reach)
    order, extent = "lower on upper" if is_swapped else "upper on lower", "whole surfaces" if is_whole else "faces by normals"
    return f"{order}, {extent}, {points or 'default'} points within {within or 'default'}"


def scene(seed: int, family: str, objective: str, *, omits: bool = False) -> Scene:
    """Return the scene of a seed and a family; `omits` leaves one of its contact pairs out."""
    rng = np.random.default_rng([seed, zlib.crc32(family.encode())])
    tolerance = float(rng.choice([0.1, 0.5, 1, 2, 4]) if rng.random() < 0.7 else 10 ** rng.uniform(-1, 0.6))
    stack = close_stack(family, tolerance, rng)
    bodies, A, noise = disturbed(stack, rng)
    sideways = tolerance * float(rng.choice([1, 1, 0.1]))
    frame = random_frame(rng)
    fixed = int(rng.choice([0, 0, 0, len(bodies) - 1, len(bodies)]))  # the last one: no body
    assembly = tc.Assembly(f"{family} {seed}", method=tc.Method(objective=objective))
    parts = declared_parts(assembly, bodies, A, frame, fixed)
    is_pressed = objective == "seating"
    for k, part in enumerate(parts):
        if k != fixed:
            assembly.locate(part, locators(frame, tolerance, sideways, is_pressed))
            if is_pressed:
                assembly.force(f"weight {k}", at=part.point(0, 0, 0), vector=tuple(frame.turn.apply((0.05, -0.02, -1))))
    if omits:
        left_out = int(rng.integers(len(stack.pairs)))
        stack = replace(stack, pairs=stack.pairs[:left_out] + stack.pairs[left_out + 1 :])
    contacts = declare_contacts(assembly, parts, stack, frame, rng)
    up = frame.turn.apply((0, 0, 1))
    assembly.measure("height", parts[-1].point(0, 0, 0), along=tuple(up))
    polyhedra = [[Polyhedron(frame.turn.apply(points @ A.T) + frame.shift) for points in pieces] for pieces in bodies]
    held = f"body {fixed} fixed" if fixed < len(bodies) else "no body fixed"
    choices = f"{noise}; {frame.name}; {contacts}; {held}; tolerances {tolerance:.2g} and {sideways:.2g}"
    return Scene(assembly, polyhedra, list(stack.pairs), (tolerance, sideways), up, choices)
