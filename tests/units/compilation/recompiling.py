"""Programs that are compiled again, with another solver or with other rows."""

from dataclasses import replace

from tolcontact.compilation import ContactGroup
from tolcontact.compilation.contact_qp import contact_qp
from tolcontact.compilation.contact_solver import ContactSolver


def recompiled(program, *, solver=None, standing=None):
    """A program with another solver, or with other points of each of its pairs that always have a row."""
    solver, groups = solver or program.solver, list[ContactGroup]()
    for compiled in program.groups:
        group = compiled.group
        points = compiled.qp.standing if standing is None else [standing[pair] for pair in group.pairs]
        qp = contact_qp(program.nominal, group, program.method, points)
        groups.append(ContactGroup(group, qp, ContactSolver(qp, solver)))
    return replace(program, solver=solver, groups=tuple(groups))
