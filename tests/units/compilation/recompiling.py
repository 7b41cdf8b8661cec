"""Programs that are compiled again, with another solver or with other rows."""

from dataclasses import replace

from tolcontact.compilation import ContactGroup
from tolcontact.compilation.contact_qp import contact_qp
from tolcontact.compilation.contact_solver import ContactSolver


def recompiled(program, *, solver=None, standing=None):
    """A program with another solver, or with other points of each of its pairs that always have a row."""
    solver, groups = solver or program.solver, [group.group for group in program.groups]
    rows = [() if standing is None else [standing[pair] for pair in group.pairs] for group in groups]
    qps = [
        contact_qp(program.nominal, group, program.gaps, program.method, points)
        for group, points in zip(groups, rows, strict=True)
    ]
    solved = tuple(ContactGroup(group, qp, ContactSolver(qp, solver)) for group, qp in zip(groups, qps, strict=True))
    return replace(program, solver=solver, groups=solved)
