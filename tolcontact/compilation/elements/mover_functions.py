"""The functions of movers, and of a kind of parts that they move: CasADi expressions of the equations of mechanics."""

from dataclasses import dataclass

import casadi as ca

from tolcontact.compilation.conditioning import coupling, whitening
from tolcontact.compilation.elements.element_functions import function_of
from tolcontact.compilation.functions import NamedFunction
from tolcontact.compilation.quadratic_terms import is_convex
from tolcontact.mechanics.correction import FREEDOMS, Mobility, Motion, increments, published, rigid
from tolcontact.mechanics.pose import ENTRIES, poses_of
from tolcontact.method import Method


@dataclass(frozen=True, eq=False)
class MoverFunctions:
    """The functions of a mover and of two coupled movers, with blocks (36) of Q and of V = U^-1.

    factor    Q, curvature -> convex
    whiten    Q, pull (6) -> V, g (6)
    couple    Q, V_i, V_j -> H, and the same once more for its mirrored place
    pull      H, y_i, y_j (6) -> force_i, force_j (6): the forces on both movers by their coupling
    step      V, y (6) -> step (6)
    """

    factor: NamedFunction
    whiten: NamedFunction
    couple: NamedFunction
    pull: NamedFunction
    step: NamedFunction


def mover_functions() -> MoverFunctions:
    """Return the functions of movers."""
    Q, second, V_i, V_j = (ca.SX.sym(name, FREEDOMS, FREEDOMS) for name in ("Q", "second", "V_i", "V_j"))
    p, q = (ca.SX.sym(name, FREEDOMS) for name in ("p", "q"))
    V, upper = whitening(Q), ca.triu(V_i)
    H = coupling(Q, upper, ca.triu(V_j))
    return MoverFunctions(
        factor=function_of("factor", {"Q": Q, "curvature": second}, {"convex": is_convex(Q + second)}),
        whiten=function_of("whiten", {"Q": Q, "pull": p}, {"V": V, "g": V.T @ p}),
        couple=function_of("couple", {"Q": Q, "V_i": V_i, "V_j": V_j}, {"H": H, "mirrored": H}),
        pull=function_of("pull", {"H": Q, "y_i": p, "y_j": q}, {"force_i": Q @ q, "force_j": Q.T @ p}),
        step=function_of("step", {"V": V_i, "y": p}, {"step": upper @ p}),
    )


def advance_function(mobility: Mobility, method: Method) -> NamedFunction:
    """Return the function of parts that the same number of movers move, in which its own comes last if it is one.

    Inputs: pose (12), movers (12, mover), centre (3), centres (3, mover), steps (6, mover), length; result: corrected (12).
    """
    count = len(mobility.movers)
    shapes = {
        "pose": (ENTRIES, 1), "movers": (ENTRIES, count), "centre": (3, 1), "centres": (3, count), "steps": (FREEDOMS, count),
        "length": (1, 1),
    }  # fmt: skip
    inputs = {name: ca.SX.sym(name, *shape) for name, shape in shapes.items()}
    poses = poses_of(ca.vec(inputs["movers"]))
    centres = [pose.apply(c) for pose, c in zip(poses, ca.horzsplit(inputs["centres"]), strict=True)]
    part = Mobility(tuple(range(count)), inputs["centre"], mobility.is_reference)
    motion = Motion([part], poses_of(inputs["pose"]), increments(ca.vec(inputs["steps"]), inputs["length"], centres))
    moved = motion.by(rigid if method.is_exact else published)[0]
    return function_of("advance", inputs, {"corrected": moved.vector()})
