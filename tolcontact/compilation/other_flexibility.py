"""A program whose elastic parts have another flexibility: that of finer meshes, or of stiffer parts."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from tolcontact.compilation.program import Program, bent_measures, compiled_group
from tolcontact.mechanics.flexibility import Bending, PartFlexibility

STIFFER = 1e9  # times the stiffness: rigid in any figure
SAME = 1e-9  # relative: equations that are equal


def with_flexibility(program: Program, parts: Sequence[PartFlexibility]) -> Program:
    """Return the program with another flexibility of its elastic parts; contact points and constant forces stay."""
    nominal, bending = program.nominal, Bending(program.nominal, parts)
    groups = tuple(
        compiled_group(nominal, compiled.group, program.method, compiled.qp.standing, parts, program.solver)
        for compiled in program.groups
    )
    return replace(program, groups=groups, bending=bending, observe_bent=bent_measures(nominal, bending))


def stiffer(program: Program, factor: float) -> Program:
    """Return the program with elastic parts of `factor` times the stiffness."""
    parts = program.bending.parts.values() if program.bending else ()
    scaled = ("C", "opening", "moved", "surface")
    return with_flexibility(
        program, [part._replace(**{name: getattr(part, name) / factor for name in scaled}) for part in parts]
    )


def overheld(program: Program) -> str:
    """Return the names of pairs that hold parts by more equations than these have freedoms; empty if none do."""
    for group in program.groups:
        rows, names = [], dict[str, None]()
        for pair in (program.nominal.pairs[k] for k in group.group.pairs):
            if not (pair.holds and pair.elastic):
                continue
            names[pair.name] = None
            for P_m, n in zip(pair.P_m, pair.n_r, strict=True):
                row = np.zeros((len(program.nominal.parts), 6))
                row[pair.moving] = [*n, *np.cross(P_m, n) / group.group.length]
                if pair.reference is not None:
                    row[pair.reference] = -row[pair.moving]
                rows.append(row.ravel())
        if rows and np.linalg.matrix_rank(rows, tol=SAME * len(rows)) < len(rows):
            first, *others = names
            return f'"{first}"' + (f" and {len(others)} more" if others else "")
    return ""
