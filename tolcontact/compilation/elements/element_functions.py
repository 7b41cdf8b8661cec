"""The functions of a kind of elements, of a kind of parts, and of movers: CasADi expressions of the equations of mechanics."""

import itertools
from collections.abc import Mapping
from dataclasses import dataclass

import casadi as ca

from tolcontact.compilation.conditioning import conditioned_rows, coupling, whitening
from tolcontact.compilation.contact_rows import RowPoints, contact_rows, slot_points
from tolcontact.compilation.elements.element import Element
from tolcontact.compilation.functions import NamedFunction
from tolcontact.compilation.outcome import reactions, row_residuals
from tolcontact.compilation.quadratic_terms import is_convex, quadratic_terms
from tolcontact.mechanics.correction import FREEDOMS, Mobility, Motion, increments, linear, published, rigid
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.objective import energy
from tolcontact.mechanics.pose import ENTRIES, poses_of
from tolcontact.mechanics.setting import Setting
from tolcontact.method import Method


def function_of(name: str, inputs: Mapping[str, ca.SX], outputs: Mapping[str, ca.SX]) -> NamedFunction:
    """Return a function of dense arrays by their names, with those of the inputs on which outputs depend."""
    everything = ca.vertcat(*(ca.vec(output) for output in outputs.values()))
    needed = {name: symbol for name, symbol in inputs.items() if ca.depends_on(everything, ca.vec(symbol))}
    return NamedFunction.dense(ca.Function(name, [*needed.values()], [*outputs.values()], [*needed], [*outputs]))


@dataclass(frozen=True, eq=False)
class ElementFunctions:
    """The functions of a kind of elements with p parts, s sides, r rows and z increments; z and y are those of its movers.

    terms     (see _inputs) -> Q (36, mover), Q_between (36, pair of movers), pull (z), slopes (r, z), gaps (r), and where
              points are projected nearness and nearness_between
    newton    the same inputs -> these, and curvature, curvature_between, hold (z); None if no step counts curvature
    rows      slopes, gaps, filled, V (36, mover), idle (r, z), length -> a (r, z), opening, lower, row_length (r)
    check     a, opening, lower, row_length, filled, y, slack, lam, scale -> residual, force (z), slack_force, multipliers (r)
    advance   poses (12 p), faces, constants, length, step (z) -> linearized (12): X_RM, linear in the step
    relate    poses (12 p), faces -> relative (12)
    energy    poses, raw, moments, faces, constants, length, count, scale -> energy
    """

    terms: NamedFunction
    newton: NamedFunction | None
    rows: NamedFunction
    check: NamedFunction
    advance: NamedFunction
    relate: NamedFunction
    energy: NamedFunction


def element_functions(element: Element, method: Method, *, projects: bool) -> ElementFunctions:
    """Return the functions of the elements of a kind, of which `element` is one; see quadratic_terms for `projects`."""
    inputs = _inputs(element)
    setting, points = _setting(element, method, inputs), _row_points(element, inputs)
    motion = setting.motion(poses_of(inputs["poses"]))
    rows = contact_rows(setting, [points], motion.poses, motion.by(linear), inputs["reactions"])
    terms = quadratic_terms(setting, rows, motion, inputs["reactions"], inputs["load"], projects=projects)
    outputs = _blocks("Q", terms.Q) | {"pull": terms.pull, "slopes": rows.slopes, "gaps": rows.gaps}
    if projects:
        outputs |= _blocks("nearness", terms.nearness)
    with_curvature = outputs | _blocks("curvature", terms.curvature) | {"hold": terms.hold}
    value = ca.substitute(energy(setting, motion.poses).value, setting.firmness, 1)
    return ElementFunctions(
        terms=function_of("terms", inputs, outputs),
        newton=function_of("newton", inputs, with_curvature) if method.is_exact else None,
        rows=_rows_function(element),
        check=_check_function(element),
        advance=function_of("advance", inputs | {"step": setting.z}, {"linearized": rows.relative}),
        relate=function_of("relate", inputs, {"relative": setting.relative(motion.poses)[0].vector()}),
        energy=function_of("energy", inputs, {"energy": value}),
    )


def _blocks(name: str, matrix: ca.SX) -> dict[str, ca.SX]:
    """Return the blocks (36, block) of a matrix (z, z) on its diagonal, and above it, by name."""
    movers = [slice(k, k + FREEDOMS) for k in range(0, matrix.size1(), FREEDOMS)]
    diagonal = [ca.vec(ca.densify(matrix[k, k])) for k in movers]
    above = [ca.vec(ca.densify(matrix[i, j])) for i, j in itertools.combinations(movers, 2)]
    return {name: ca.horzcat(*diagonal), f"{name}_between": ca.horzcat(ca.SX(FREEDOMS**2, 0), *above)}


def _inputs(element: Element) -> dict[str, ca.SX]:
    """Return the inputs of `terms` by name: those of contact_qp for the element's parts, sides and rows, and some more.

    faces (12, face)     poses of the deviating faces in their parts
    heights (2)          of the moving and the reference face
    constants            see Element
    length, count        of the whole group
    scale, load          scale of the objective, and sum of all reactions
    """
    rows = element.rows
    shapes = {
        "poses": (ENTRIES * len(element.parts), 1),
        "raw": (ENTRIES * len(element.parts), 1),
        "moments": (MOMENTS, len(element.sides)),
        "reactions": (rows, 1),
        "faces": (ENTRIES, sum(element.deviating)),
        "constants": (len(element.constants), 1),
        **dict.fromkeys(("firmness", "length", "count", "scale", "load"), (1, 1)),
    }
    if element.contact.round is not None:
        shapes["heights"] = (2, 1)
    else:
        shapes |= dict.fromkeys(("P_m", "P_r", "n_r"), (3, rows))
    if element.has_slots:
        shapes |= {"bend": (ENTRIES, 1), "filled": (rows, 1)}
    return {name: ca.SX.sym(name, *shape) for name, shape in shapes.items()}


def _setting(element: Element, method: Method, inputs: Mapping[str, ca.SX]) -> Setting:
    faces = iter(poses_of(ca.vec(inputs["faces"])))
    moving, reference = (next(faces) if deviates else None for deviates in element.deviating)
    return Setting(
        element.nominal,
        element.symbolic(inputs["constants"], inputs["length"], inputs["count"]),
        method,
        raw=poses_of(inputs["raw"]),
        moments=inputs["moments"],
        deviations=ca.SX(0, 1),
        firmness=inputs["firmness"],
        z=ca.SX.sym("z", element.size),
        faces=[(moving, reference)],
        heights=[inputs.get("heights", ca.SX(2, 1))],
        scale=inputs["scale"],
    )


def _row_points(element: Element, inputs: Mapping[str, ca.SX]) -> RowPoints:
    if element.contact.round is not None:
        return RowPoints([])
    filled = inputs.get("filled", ca.SX.ones(element.rows))
    points = list(slot_points({**inputs, "filled": filled}))
    return RowPoints(points, inputs["bend"] if element.has_slots else None)


def _rows_function(element: Element) -> NamedFunction:
    rows, size, movers = element.rows, element.size, len(element.movers)
    inputs = {
        "slopes": ca.SX.sym("slopes", rows, size),
        "gaps": ca.SX.sym("gaps", rows),
        "V": ca.SX.sym("V", FREEDOMS**2, movers),
        "idle": ca.SX.sym("idle", rows, size),  # only used in slots that can be empty
        "length": ca.SX.sym("length"),
    }
    filled = ca.SX.sym("filled", rows) if element.has_slots else ca.SX.ones(rows)
    if element.has_slots:
        inputs["filled"] = filled
    A = inputs["slopes"] @ ca.diagcat(*(ca.triu(block) for block in blocks_of(inputs["V"])))
    idle = [inputs["idle"][k, :].T for k in range(rows)]
    result = conditioned_rows(ca.densify(A), inputs["gaps"], filled, idle, inputs["length"])
    names = ("a", "opening", "lower", "row_length")
    return function_of("rows", inputs, dict(zip(names, result, strict=True)))


def _check_function(element: Element) -> NamedFunction:
    rows, size = element.rows, element.size
    shapes = {"a": (rows, size), "y": (size, 1), **dict.fromkeys(("slack", "scale"), (1, 1))}
    shapes |= dict.fromkeys(("opening", "lower", "row_length", "filled", "lam"), (rows, 1))
    inputs = {name: ca.SX.sym(name, *shape) for name, shape in shapes.items()}
    a, opening, length, lam = (inputs[name] for name in ("a", "opening", "row_length", "lam"))
    excess = a @ inputs["y"] + opening * inputs["slack"] - inputs["lower"]
    outputs = {
        "residual": ca.norm_inf(row_residuals(excess, lam, length)),
        "force": a.T @ lam,
        "slack_force": ca.dot(opening, lam),
        "multipliers": reactions(lam, length, inputs["filled"], inputs["scale"]),
    }
    return function_of("check", inputs, outputs)


def blocks_of(columns: ca.SX) -> list[ca.SX]:
    """Return blocks (6, 6), whose entries, column by column, are the columns (36, block)."""
    return [ca.reshape(column, FREEDOMS, FREEDOMS) for column in ca.horzsplit(columns)]


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
