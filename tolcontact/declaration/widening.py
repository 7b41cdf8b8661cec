"""Wider or narrower tolerances in a copy of a model, as if suppliers were 20 % worse."""

import copy
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any

from tolcontact.declaration.feature_tolerance import GeometricTolerance
from tolcontact.declaration.part import Feature, Pattern
from tolcontact.declaration.size import Size
from tolcontact.declaration.tolerance import Tolerance
from tolcontact.declaration.values import is_length
from tolcontact.errors import nearest_name

MAX_LISTED = 12  # names in a message


def widened(assembly: Any, factor: float, names: Sequence[str]) -> Any:
    """Return a copy of an assembly with tolerances `factor` times as wide, about their centres (see Assembly.widened)."""
    if not (is_length(factor) and factor > 0):
        raise ValueError(f"widened: factor is {factor!r}; expected a number above 0, such as 1.2")
    copied = copy.deepcopy(assembly)
    toleranced = list(_toleranced(copied))
    owners = dict.fromkeys(name for labels, _ in toleranced for name in labels)
    if unknown := [name for name in names if name not in owners]:
        listed = ", ".join(list(owners)[:MAX_LISTED]) or "none"
        fault = f"no part, locator, feature or variable with a tolerance{nearest_name(unknown[0], owners)}"
        raise ValueError(f'widened: "{unknown[0]}" is {fault}; these are, for example: {listed}')
    for labels, thing in toleranced:
        if not names or not set(labels).isdisjoint(names):
            name = "tolerances" if isinstance(thing, Feature | Pattern) else "tolerance"
            value = getattr(thing, name)
            scaled = [_wider(t, factor, labels[-1]) for t in (value if isinstance(value, tuple) else (value,))]
            wider = tuple(scaled) if isinstance(value, tuple) else scaled[0]
            for owner in (thing, *vars(thing).get("members", ())):  # the members of a pattern have its tolerances
                object.__setattr__(owner, name, wider)
    return copied


def _toleranced(assembly: Any) -> Iterator[tuple[list[str], Any]]:
    """Yield the names of all that has tolerances, and the thing itself."""
    for location in assembly.locations:
        if location.tolerance is not None:
            yield [location.part.name], location
        for locator in location.locators:
            if locator.tolerance is not None:
                yield [location.part.name, f"{location.part.name}.{locator.name}"], locator
    for feature in (feature for part in assembly.parts for feature in part.toleranced if feature.tolerances):
        yield [feature.part.name, feature.label], feature
    for variable in assembly.variables:
        yield [variable.name], variable


def _wider(tolerance: Any, factor: float, owner: str) -> Any:
    """Return a tolerance, a size or a control of a feature that is `factor` times as wide, about its centre.

    Raises ValueError for a zone that would no longer contain the nominal surface, which no drawing can state by `outside`.
    """
    if isinstance(tolerance, GeometricTolerance):
        width, outside = factor * tolerance.width, tolerance.outside
        if outside is not None:
            outside += (factor - 1) * tolerance.width / 2
            if not 0 <= outside <= width:
                fault = f"{factor:g} times as wide about its centre, this zone does not contain the nominal surface"
                raise ValueError(f'widened: "{owner}" has {tolerance}; {fault}; choose other names, or declare a narrower zone')
        return replace(tolerance, width=width, outside=outside)
    if not isinstance(tolerance.distribution, str):
        tolerance = replace(tolerance, distribution=_wider_distribution(tolerance.distribution, factor))
    if isinstance(tolerance, Tolerance):
        return tolerance if tolerance.range is None else replace(tolerance, range=factor * tolerance.range)
    assert isinstance(tolerance, Size)
    middle, half = (tolerance.upper + tolerance.lower) / 2, factor * (tolerance.upper - tolerance.lower) / 2
    return replace(tolerance, upper=middle + half, lower=middle - half, tolerance_class="")


def _wider_distribution(frozen: Any, factor: float) -> Any:
    """Return a frozen distribution of scipy.stats that is `factor` times as wide, about its median."""
    shapes, scaling = frozen.args[: frozen.dist.numargs], frozen.args[frozen.dist.numargs :]
    options = {"loc": 0.0, "scale": 1.0} | dict(zip(("loc", "scale"), scaling, strict=False)) | frozen.kwds
    median = float(frozen.ppf(0.5))
    options |= {"loc": median + factor * (options["loc"] - median), "scale": factor * options["scale"]}
    return frozen.dist(*shapes, **options)
