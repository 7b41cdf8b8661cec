"""The functions of a kind of contact pairs."""

from collections.abc import Mapping

import casadi as ca

from tolcontact.compilation.conditioning import conditioned_rows, openings
from tolcontact.compilation.contact_rows import RowPoints, contact_rows, slot_points
from tolcontact.compilation.elements.element_functions import (
    BLOCK,
    Functions,
    common_shapes,
    function_of,
    setting_of,
    symbols,
    term_functions,
    upper_blocks,
)
from tolcontact.compilation.elements.pair_element import PairElement
from tolcontact.compilation.functions import NamedFunction
from tolcontact.compilation.outcome import reactions, row_residuals
from tolcontact.mechanics.correction import linear
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.pose import ENTRIES, poses_of
from tolcontact.method import Method


def pair_functions(element: PairElement, method: Method, *, projects: bool) -> Functions:
    """Return the functions of the pairs of a kind, of which `element` is one; see quadratic_terms for `projects`.

    For p parts, r rows and z increments, with z and y those of the element's movers, they are those of term_functions, and:

    terms     slopes (r, z), gaps (r)
    rows      slopes, gaps, filled, V (36, mover), idle (r, z), length, compliance, scale -> a (r, z), opening, lower,
              row_length (r)
    check     a, opening, lower, row_length, filled, y, slack (r), lam, scale -> residual, force (z), multipliers (r), and
              slack_force of the pair and of its springs
    advance   poses (12 p), faces, constants, length, step (z) -> linearized (12): X_RM, linear in the step
    relate    poses (12 p), faces -> relative (12)
    """
    inputs = _inputs(element)
    faces = iter(poses_of(ca.vec(inputs["faces"])))
    moving, reference = (next(faces) if deviates else None for deviates in element.deviating)
    heights = [inputs.get("heights", ca.SX(2, 1))]
    setting = setting_of(element, method, inputs, moments=inputs["moments"], faces=[(moving, reference)], heights=heights)
    motion = setting.motion(poses_of(inputs["poses"]))
    rows = contact_rows(setting, [_row_points(element, inputs)], motion.poses, motion.by(linear), inputs["reactions"])
    results = {"slopes": rows.slopes, "gaps": rows.gaps}
    return {
        **term_functions(setting, rows, motion, inputs, results, projects=projects),
        "rows": _rows_function(element, inputs),
        "check": _check_function(element, inputs),
        "advance": function_of("advance", inputs | {"step": setting.z}, {"linearized": rows.relative}),
        "relate": function_of("relate", inputs, {"relative": setting.relative(motion.poses)[0].vector()}),
    }


def _inputs(element: PairElement) -> dict[str, ca.SX]:
    """Return the inputs of `terms` by name: those of contact_qp for the element's sides and rows, and some more.

    faces (12, face)     poses of the deviating faces in their parts
    heights (2)          of the moving and the reference face
    compliance           of the rows that give way
    """
    rows = element.rows
    shapes = common_shapes(element) | {
        "moments": (MOMENTS, len(element.sides)),
        "reactions": (rows, 1),
        "faces": (ENTRIES, sum(element.deviating)),
        "compliance": (len(element.springs), 1),
    }
    if element.contact.round is not None:
        shapes["heights"] = (2, 1)
    else:
        shapes |= dict.fromkeys(("P_m", "P_r", "n_r"), (3, rows))
    if element.has_slots:
        shapes |= {"bend": (ENTRIES, 1), "filled": (rows, 1)}
    return symbols(shapes)


def _row_points(element: PairElement, inputs: Mapping[str, ca.SX]) -> RowPoints:
    compliance = _compliance(element, inputs)
    if element.contact.round is not None:
        return RowPoints([], compliance)
    points = list(slot_points({**inputs, "filled": _filled(element, inputs)}))
    return RowPoints(points, compliance, inputs["bend"] if element.has_slots else None)


def _compliance(element: PairElement, inputs: Mapping[str, ca.SX]) -> ca.SX:
    """Return the compliance (row, 1) of all rows."""
    compliance = ca.SX.zeros(element.rows)
    compliance[element.springs] = inputs["compliance"]
    return compliance


def _filled(element: PairElement, inputs: Mapping[str, ca.SX]) -> ca.SX:
    return inputs.get("filled", ca.SX.ones(element.rows))


def _rows_function(element: PairElement, inputs: Mapping[str, ca.SX]) -> NamedFunction:
    rows, size = element.rows, element.size
    shapes = {"slopes": (rows, size), "gaps": (rows, 1), "V": (BLOCK, len(element.movers)), "idle": (rows, size)}
    inputs = {**inputs, **symbols(shapes)}
    idle = [inputs["idle"][k, :].T for k in range(rows)]  # only used in slots that can be empty
    opening = openings(_compliance(element, inputs), inputs["scale"])
    A = ca.densify(inputs["slopes"] @ upper_blocks(inputs["V"]))
    result = conditioned_rows(A, inputs["gaps"], _filled(element, inputs), idle, inputs["length"], opening)
    names = ("a", "opening", "lower", "row_length")
    return function_of("rows", inputs, dict(zip(names, result, strict=True)))


def _check_function(element: PairElement, inputs: Mapping[str, ca.SX]) -> NamedFunction:
    rows, size = element.rows, element.size
    shapes = {"a": (rows, size), "y": (size, 1), **dict.fromkeys(("opening", "lower", "row_length", "lam", "slack"), (rows, 1))}
    inputs = {**inputs, "filled": ca.SX.sym("filled", rows), **symbols(shapes)}
    a, opening, length, lam = (inputs[name] for name in ("a", "opening", "row_length", "lam"))
    excess = a @ inputs["y"] + opening * inputs["slack"] - inputs["lower"]
    by_row = opening * lam
    rigid = [row for row in range(rows) if row not in element.springs]
    outputs = {
        "residual": ca.norm_inf(row_residuals(excess, lam, length)),
        "force": a.T @ lam,
        "slack_force": ca.vertcat(ca.sum1(by_row[rigid]), by_row[element.springs]),
        "multipliers": reactions(lam, length, inputs["filled"], inputs["scale"]),
    }
    return function_of("check", inputs, outputs)
