"""The functions of a kind of parts with forces and two-sided locators."""

import casadi as ca

from tolcontact.compilation.contact_rows import contact_rows
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
from tolcontact.compilation.elements.part_element import PartElement
from tolcontact.mechanics.correction import linear
from tolcontact.mechanics.displacement import MOMENTS
from tolcontact.mechanics.placement import misfit
from tolcontact.mechanics.pose import poses_of
from tolcontact.method import Method


def part_functions(element: PartElement, method: Method, *, projects: bool) -> Functions:
    """Return the functions of the parts of a kind, of which `element` is one; see quadratic_terms for `projects`.

    For e equations and z increments, with z and y those of the element's movers, they are those of term_functions, and, if
    there are equations:

    terms     slopes (e, z), lower (e)
    rows      slopes, V (36, mover) -> a (e, z)
    check     a, y, lower, lam -> residual, force (z)
    astray    poses, raw, steps (e), constants -> astray: the largest misfit
    """
    size, count = element.size, element.equations
    inputs = symbols(common_shapes(element) | {"steps": (element.locators, 1)})
    steps = [inputs["steps"]] * len(element.group.holds)
    setting = setting_of(element, method, inputs, moments=ca.SX(MOMENTS, 0), steps=steps)
    motion = setting.motion(poses_of(inputs["poses"]))
    moved = motion.by(linear)
    rows = contact_rows(setting, [], motion.poses, moved, ca.SX(0, 1))
    if not count:
        return term_functions(setting, rows, motion, inputs, {}, projects=projects)
    error = misfit(setting, moved, linear=True)
    results = {"slopes": setting.slope(error), "lower": -setting.at_rest(error)}
    equations = symbols({
        "a": (count, size), "slopes": (count, size), "V": (BLOCK, len(element.movers)), "y": (size, 1),
        **dict.fromkeys(("lower", "lam"), (count, 1)),
    })  # fmt: skip
    excess = equations["a"] @ equations["y"] - equations["lower"]
    check = {"residual": ca.norm_inf(excess), "force": equations["a"].T @ equations["lam"]}
    return {
        **term_functions(setting, rows, motion, inputs, results, projects=projects),
        "rows": function_of("rows", equations, {"a": equations["slopes"] @ upper_blocks(equations["V"])}),
        "check": function_of("check", equations, check),
        "astray": function_of("astray", inputs, {"astray": ca.norm_inf(misfit(setting, motion.poses))}),
    }
