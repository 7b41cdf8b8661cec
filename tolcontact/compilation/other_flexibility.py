"""A program whose elastic parts have another flexibility: that of finer meshes, or of stiffer parts."""

from collections.abc import Sequence
from dataclasses import replace

import casadi as ca

from tolcontact.compilation.contact_qp import contact_qp, row_count
from tolcontact.compilation.contact_solver import ContactSolver
from tolcontact.compilation.program import ContactGroup, Program, _observe_bent
from tolcontact.mechanics.flexibility import Bending, PartFlexibility, group_flexibility
from tolcontact.mechanics.pose import ENTRIES


def with_flexibility(program: Program, parts: Sequence[PartFlexibility]) -> Program:
    """Return the program with another flexibility of its elastic parts; contact points and constant forces stay."""
    nominal, bending = program.nominal, Bending(program.nominal, parts)
    groups = []
    for compiled in program.groups:
        counts = [row_count(points) for points in compiled.qp.standing]
        flexibility = group_flexibility(nominal, compiled.group, counts, parts)
        qp = contact_qp(nominal, compiled.group, program.gaps, program.method, compiled.qp.standing, flexibility=flexibility)
        groups.append(ContactGroup(compiled.group, qp, ContactSolver(qp, program.solver)))
    entries, d = ca.SX.sym("poses", ENTRIES * len(nominal.parts)), ca.SX.sym("deviations", len(nominal.contributors))
    return replace(program, groups=tuple(groups), bending=bending, observe_bent=_observe_bent(nominal, entries, d, bending))
