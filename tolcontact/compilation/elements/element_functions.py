"""The common functions of all kinds of elements: CasADi expressions of the equations of mechanics."""

import itertools
from collections.abc import Mapping, Sequence

import casadi as ca

from tolcontact.compilation.contact_rows import Rows
from tolcontact.compilation.elements.element import Element
from tolcontact.compilation.functions import NamedFunction
from tolcontact.compilation.quadratic_terms import quadratic_terms
from tolcontact.mechanics.correction import FREEDOMS, Motion
from tolcontact.mechanics.group_equations import GroupEquations
from tolcontact.mechanics.objective import energy
from tolcontact.mechanics.pose import ENTRIES, Pose, poses_of
from tolcontact.method import Method

BLOCK = FREEDOMS**2

Functions = Mapping[str, NamedFunction]  # of a kind of elements, by name


def function_of(name: str, inputs: Mapping[str, ca.SX], outputs: Mapping[str, ca.SX]) -> NamedFunction:
    """Return a function of dense arrays by name; inputs that no output depends on are omitted."""
    everything = ca.vertcat(*(ca.vec(output) for output in outputs.values()))
    needed = {name: symbol for name, symbol in inputs.items() if ca.depends_on(everything, ca.vec(symbol))}
    return NamedFunction.dense(ca.Function(name, [*needed.values()], [*outputs.values()], [*needed], [*outputs]))


def symbols(shapes: Mapping[str, tuple[int, int]]) -> dict[str, ca.SX]:
    """Return symbols by name, from their shapes."""
    return {name: ca.SX.sym(name, *shape) for name, shape in shapes.items()}


def common_shapes(element: Element) -> dict[str, tuple[int, int]]:
    """Return the shapes of the inputs that all kinds of elements have, by name: inputs of contact_qp for its parts, and more.

    constants        see Element
    length, count    of the whole group
    scale, load      scale of the objective, and sum of all reactions
    """
    return {
        **dict.fromkeys(("poses", "raw"), (ENTRIES * len(element.parts), 1)),
        "constants": (len(element.constants), 1),
        **dict.fromkeys(("regularization_factor", "length", "count", "scale", "load"), (1, 1)),
    }


def element_equations(
    element: Element,
    method: Method,
    inputs: Mapping[str, ca.SX],
    *,
    moments: ca.SX,
    faces: Sequence[tuple[Pose | None, Pose | None]] = (),
    heights: Sequence[ca.SX] = (),
    steps: Sequence[ca.SX] = (),
) -> GroupEquations:
    """Return the equations of an element, with the scale of the whole group."""
    return GroupEquations(
        element.nominal,
        element.symbolic(inputs["constants"], inputs["length"], inputs["count"]),
        method,
        raw=poses_of(inputs["raw"]),
        moments=moments,
        deviations=ca.SX(0, 1),
        regularization_factor=inputs["regularization_factor"],
        z=ca.SX.sym("z", element.size),
        faces=faces,
        heights=heights,
        steps=steps,
        scale=inputs["scale"],
    )


def term_functions(
    system: GroupEquations,
    rows: Rows,
    motion: Motion,
    inputs: Mapping[str, ca.SX],
    results: Mapping[str, ca.SX],
    *,
    projects: bool,
) -> dict[str, NamedFunction]:
    """Return the functions `terms`, `newton` and `energy`; the first two have further `results`.

    terms     -> Q (36, mover), Q_between (36, pair of movers), gradient (z), and, if points are projected, proximal_hessian
              and proximal_hessian_between
    newton    -> these, and curvature, curvature_between, augmented_gradient (z); omitted if no step counts curvature
    energy    -> energy
    """
    terms = quadratic_terms(system, rows, motion, inputs.get("reactions", ca.SX(0, 1)), inputs["load"], projects=projects)
    outputs = _blocks("Q", terms.Q) | {"gradient": terms.gradient, **results}
    if projects:
        outputs |= _blocks("proximal_hessian", terms.proximal_hessian)
    value = (
        ca.substitute(energy(system, motion.poses).value, system.regularization_factor, 1) + rows.spring_energy() / terms.scale
    )
    functions = {
        "terms": function_of("terms", inputs, outputs),
        "energy": function_of("energy", inputs, {"energy": value}),
    }
    if system.method.is_exact:
        with_curvature = outputs | _blocks("curvature", terms.curvature) | {"augmented_gradient": terms.augmented_gradient}
        functions["newton"] = function_of("newton", inputs, with_curvature)
    return functions


def _blocks(name: str, matrix: ca.SX) -> dict[str, ca.SX]:
    """Return the blocks (36, block) of a matrix (z, z) on its diagonal, and above it, by name."""
    movers = [slice(k, k + FREEDOMS) for k in range(0, matrix.size1(), FREEDOMS)]
    diagonal = [ca.vec(ca.densify(matrix[k, k])) for k in movers]
    couplings = [ca.vec(ca.densify(matrix[i, j])) for i, j in itertools.combinations(movers, 2)]
    return {name: ca.horzcat(*diagonal), f"{name}_between": ca.horzcat(ca.SX(BLOCK, 0), *couplings)}


def upper_blocks(columns: ca.SX) -> ca.SX:
    """Return the block diagonal matrix (z, z) of upper triangular blocks, from their entries as columns (36, block)."""
    return ca.diagcat(*(ca.triu(ca.reshape(column, FREEDOMS, FREEDOMS)) for column in ca.horzsplit(columns)))
