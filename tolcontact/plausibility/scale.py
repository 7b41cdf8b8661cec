"""Deviations out of scale: zones, distributions, populations and causes that do not fit their part, size or tolerance."""

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from tolcontact.declaration import Variable
from tolcontact.declaration.scale import (
    COARSEST,
    CONSTANT_SHARE,
    FINEST,
    MAX_ZONES,
    Scale,
    doubt_of_distribution,
    doubt_of_rows,
    grade_width,
)
from tolcontact.discretization.scales import centre_and_width, scales
from tolcontact.features import Freedom
from tolcontact.plausibility.trial_draws import TrialDraws

SIX_SIGMA = 6.0  # of a zone
MAX_EFFECT, MIN_EFFECT = 10.0, 0.005  # widths of a tolerance: what a plausible variable adds to it
MAX_CP = 10.0


def out_of_scale(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each population, distribution and variable that does not fit what it deviates, or its dimension."""
    program = draws.program
    freedoms = {freedom.label: freedom for freedom in program.draws.contributors}
    stated = scales(program.nominal)
    by_label = {
        label: scale if scale.width else replace(scale, width=SIX_SIGMA * math.sqrt(freedoms[label].variance))
        for label, scale in stated.items()
    }
    measured, variables = dict[str, np.ndarray](), {cause.name: cause for cause in program.nominal.assembly.variables}
    for population in program.nominal.assembly.populations:
        columns = dict(zip(population.columns, population.values.T, strict=True))
        measured |= columns
        for label, values in columns.items():
            doubt = doubt_of_rows(by_label[label], label, values) if label in by_label else ""
            if doubt := doubt or (_doubt_of_dimension(variables[label], values) if label in variables else ""):
                yield f"{population.designation}: {doubt}"
                break
    reported = set[tuple[str, str]]()
    for label, freedom in freedoms.items():
        doubt = "" if label in measured else _doubt(freedom, stated.get(label))
        key = label.rpartition(".")[0], doubt
        if doubt and key not in reported:  # once for the locators of a part
            reported.add(key)
            yield f'{freedom.source} "{label}": {doubt}'
    for variable in variables.values():
        centre, width = centre_and_width(freedoms[variable.name])
        if variable.name in measured:
            values = measured[variable.name]
            centre, width = float(values.mean()), SIX_SIGMA * float(values.std())
        yield from _doubts_of_variable(variable, centre, width, by_label)


def _doubt_of_dimension(dimension: Variable, values: np.ndarray) -> str:
    """Return what to do about measured rows (row,) of a dimension that are absolute; empty if they may be deviations.

    Absolute values are far beyond its zone, and much nearer to its nominal value.
    """
    zone = max(SIX_SIGMA * float(values.std()), dimension.limits.width if dimension.limits else 0.0)
    centre, nominal = float(values.mean()), dimension.nominal or 0.0
    if abs(centre) <= MAX_ZONES * zone or abs(centre - nominal) >= abs(centre) / 2:
        return ""
    return (
        f"{dimension.name} is around {centre:.6g} {dimension.units}, near its nominal value, and deviations from it are "
        f'expected; subtract it, as in population({{"{dimension.name}": values - {nominal:g}}})'
    )


def _doubt(freedom: Freedom, scale: Scale | None) -> str:
    """Return what is odd about the distribution of a freedom itself."""
    controls = freedom.tolerance or freedom.geometric
    if controls is not None and (controls.cp or 1.0) > MAX_CP:
        return f"its cp is {controls.cp:g}, which no process has; a capability of 133 % is 1.33"
    if scale is None or freedom.tolerance is None or isinstance(freedom.tolerance.distribution, str):
        return ""
    return doubt_of_distribution(scale, *centre_and_width(freedom))


def _doubts_of_variable(variable: Variable, centre: float, width: float, by_label: dict[str, Scale]) -> Iterator[str]:
    """Yield what is odd about what a variable, of a centre and a width, adds to the first contributor that it does not fit."""
    for label, factor in variable.drives.items():
        scale = by_label.get(label)
        if scale is None or not factor or not width:
            continue
        has_zone = scale.width > CONSTANT_SHARE * scale.part
        largest = MAX_EFFECT * scale.width if has_zone else grade_width(COARSEST, scale.extent)
        smallest = MIN_EFFECT * scale.width if has_zone else grade_width(FINEST, scale.extent)
        effect, offset = abs(factor) * width, factor * centre
        if effect < smallest or max(effect, abs(offset)) > largest:
            zone = f"its own zone of {scale.width:.3g} mm" if has_zone else f"a length of {scale.extent:.4g} mm"
            yield (
                f"{variable.designation}: it adds {offset:.3g} ± {effect / 2:.2g} mm (3 sigma) to {label}, which does not fit "
                f"{zone}; check its tolerance [{variable.units}] and its factor [mm per {variable.units}]"
            )
            return
