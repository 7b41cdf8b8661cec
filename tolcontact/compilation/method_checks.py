"""Faults of a model for the chosen method: springs, placed parts and forces that it cannot count."""

from collections.abc import Sequence

import numpy as np

from tolcontact.declaration.locator import FIRST_ORDER
from tolcontact.discretization import ContactPoints, Nominal
from tolcontact.errors import Faults, designation
from tolcontact.mechanics.correction import FREEDOMS
from tolcontact.mechanics.groups import Group
from tolcontact.method import Method


def check_method(nominal: Nominal, method: Method) -> None:
    """Raise ModelError for a method that does not suit the model."""
    _check_elastic(nominal, method)
    _check_placing(nominal, method)
    _check_springs(nominal, method)


def _check_elastic(nominal: Nominal, method: Method) -> None:
    """Raise ModelError for elastic parts that the method does not bend, or whose faces are measured."""
    elastic = {index for index, part in enumerate(nominal.parts) if part.part.elasticity is not None}
    if not elastic:
        return
    name = nominal.parts[min(elastic)].name
    if not (method.minimizes.presses and method.is_exact):
        Faults(
            [
                f'part "{name}" is elastic, which needs the objective "seating" and the resolution "exact"; '
                f'here they are "{method.objective}" and "{method.resolution}"; choose those, or leave elastic out'
            ]
        ).refuse(nominal.assembly.name)
    faults = Faults(
        f"{designation(measure.noun, measure)}: it is a function of poses, which do not tell how parts bend; measure points, "
        "and combine these measures, as in tc.Combination"
        for measure in nominal.measures
        if measure.is_expression
    )
    for measure, measurement in zip(nominal.measures, nominal.measurements, strict=True):
        bent = [part.name for part in measure.parts if part.elasticity is not None and measurement is not None]
        if bent:
            faults.append(
                f'{designation(measure.noun, measure)}: it measures faces of part "{bent[0]}", which is elastic; '
                "measure displacements of points, or their distances"
            )
    faults.refuse(nominal.assembly.name)


def _check_placing(nominal: Nominal, method: Method) -> None:
    """Raise ModelError for placed parts under forces, if they are located by springs or by too many locators."""
    faults = Faults(
        f'part "{part.name}": its locators are placed by "{part.locators.placing}", and if forces press, they have to be at '
        "most six, without a stiffness; leave placing out, or declare the part fixed=True"
        for index, part in enumerate(nominal.parts)
        if index in part.movers and part.locators.placing != FIRST_ORDER and method.minimizes.presses
        if len(part.locators) > FREEDOMS or part.locators.springy.any()
    )
    faults.refuse(nominal.assembly.name)


def _check_springs(nominal: Nominal, method: Method) -> None:
    """Raise ModelError for a stiffness without effect, or without forces and repeated steps, which it needs."""
    faults = Faults(
        f'locator "{part.locators.labels[index]}": it has a stiffness, but part "{part.name}" is fixed=True, so forces do not '
        "move it; leave stiffness out, or declare the part fixed=False"
        for part in nominal.parts
        for index in (np.flatnonzero(part.locators.springy)[:1] if not part.free else ())
    )
    faults.refuse(nominal.assembly.name)
    if method.minimizes.presses and method.is_exact:
        return
    faults = Faults(
        f'{_compliant_name(pair)} has a stiffness, which needs the objective "seating" and the resolution "exact"; '
        f'here they are "{method.objective}" and "{method.resolution}"; choose those, or leave stiffness out'
        for pair in nominal.pairs
        if pair.is_springy
    )
    faults.refuse(nominal.assembly.name)


def _compliant_name(pair: ContactPoints) -> str:
    if pair.pulls is not None:
        return f'locator "{pair.name}": it'
    return f"{pair.name}: a support" if pair.is_supports else f'contact pair "{pair.name}": it'


def check_forces(nominal: Nominal, groups: Sequence[Group]) -> None:
    """Raise ModelError for an objective that needs forces without any, or with a force on a part that contact cannot move."""
    moved = {part for group in groups for part, mobility in zip(group.parts, group.mobilities, strict=True) if mobility.movers}
    faults = Faults(
        f'force "{force.name}" acts on part "{force.at.part.name}", which contact cannot move, but the objective is "seating"; '
        "leave the force out, or declare the part free, with its contacts"
        for force in nominal.assembly.forces
        if nominal.part_index(force.at.part, force.station) not in moved
    )
    if not nominal.assembly.forces and not len(nominal.loads):  # locators bend elastic parts, too
        faults.append('objective "seating" needs a force, and none is declared; declare one with assembly.force(...)')
    faults.refuse(nominal.assembly.name)
