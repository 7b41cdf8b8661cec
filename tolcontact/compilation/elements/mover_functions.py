"""The functions of movers, and of the parts that they move: CasADi expressions of the equations of mechanics."""

from dataclasses import dataclass

import casadi as ca
import numpy as np

from tolcontact.arrays import Array, Float
from tolcontact.compilation.conditioning import coupling, whitening
from tolcontact.compilation.elements.element_batch import blocks
from tolcontact.compilation.elements.element_functions import function_of
from tolcontact.compilation.functions import IndexedFunction, NamedFunction, located
from tolcontact.compilation.quadratic_terms import is_convex
from tolcontact.mechanics.correction import FREEDOMS, Mobility, Motion, increments, published, rigid
from tolcontact.mechanics.groups import Group
from tolcontact.mechanics.pose import ENTRIES, poses_of
from tolcontact.method import Method


@dataclass(frozen=True, eq=False)
class MoverFunctions:
    """The functions of a mover and of two coupled movers, with blocks (36) of Q and of V = U^-1.

    factor            Q, curvature -> convex
    whiten            Q, gradient (6) -> V, g (6)
    couple            Q, V_i, V_j -> H, and a copy of it for the mirrored block
    coupling_forces   H, y_i, y_j (6) -> force_i, force_j (6): the forces on both movers by their coupling
    step              V, y (6) -> step (6)
    """

    factor: NamedFunction
    whiten: NamedFunction
    couple: NamedFunction
    coupling_forces: NamedFunction
    step: NamedFunction


def mover_functions() -> MoverFunctions:
    """Return the functions of movers."""
    Q, second, V_i, V_j = (ca.SX.sym(name, FREEDOMS, FREEDOMS) for name in ("Q", "second", "V_i", "V_j"))
    p, q = (ca.SX.sym(name, FREEDOMS) for name in ("p", "q"))
    V, upper = whitening(Q), ca.triu(V_i)
    H = coupling(Q, upper, ca.triu(V_j))
    return MoverFunctions(
        factor=function_of("factor", {"Q": Q, "curvature": second}, {"convex": is_convex(Q + second)}),
        whiten=function_of("whiten", {"Q": Q, "gradient": p}, {"V": V, "g": V.T @ p}),
        couple=function_of("couple", {"Q": Q, "V_i": V_i, "V_j": V_j}, {"H": H, "mirrored": H}),
        coupling_forces=function_of("coupling_forces", {"H": Q, "y_i": p, "y_j": q}, {"force_i": Q @ q, "force_j": Q.T @ p}),
        step=function_of("step", {"V": V_i, "y": p}, {"step": upper @ p}),
    )


def advance_function(mobility: Mobility, method: Method) -> NamedFunction:
    """Return the function of parts with the same number of movers; a part that is a mover is the last of its movers.

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


class CorrectedPoses:
    """The poses of all parts of a group after a step of its movers."""

    def __init__(self, group: Group, method: Method) -> None:
        kinds: dict[tuple[int, bool], list[int]] = {}
        for part, mobility in enumerate(group.mobilities):
            if mobility.movers:
                kinds.setdefault((len(mobility.movers), mobility.is_reference), []).append(part)
        self._centres = np.concatenate([np.asarray(mobility.centre).ravel() for mobility in group.mobilities])[None]
        self._length = np.full((1, 1), group.length)
        self._functions = [_of_parts(group, method, np.array(parts)) for parts in kinds.values()]

    def __call__(self, poses: Float[Array, "n _"], step: Float[Array, "n _"]) -> Float[Array, "n _"]:
        """Return the poses (n, 12 * part) after steps (n, 6 * mover) [mm]."""
        corrected = poses.copy()
        arrays = {
            "pose": poses, "movers": poses, "steps": step, "centre": self._centres, "centres": self._centres,
            "length": self._length, "corrected": corrected,
        }  # fmt: skip
        shared = located(arrays)
        for function in self._functions:
            function(len(poses), shared)
        return corrected


def _of_parts(group: Group, method: Method, parts: np.ndarray) -> IndexedFunction:
    """Return the function of parts with equally many movers."""
    movers = np.array([group.mobilities[part].movers for part in parts])
    mover_parts = np.array([group.position(part) for part in group.free])[movers]
    function, part_indices = advance_function(group.mobilities[parts[0]], method), parts[:, None]
    return function.at({
        **dict.fromkeys(("pose", "corrected"), blocks(part_indices, ENTRIES)),
        "movers": blocks(mover_parts, ENTRIES),
        "steps": blocks(movers, FREEDOMS),
        "centre": blocks(part_indices, 3),
        "centres": blocks(mover_parts, 3),
        "length": np.zeros(part_indices.shape, dtype=int),
    })  # fmt: skip
