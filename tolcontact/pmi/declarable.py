"""The annotations of a file that features can state: tolerances and sizes as they are declared. Lengths in mm."""

import math
from collections.abc import Mapping
from typing import Any

from tolcontact.declaration import feature_tolerance as declared
from tolcontact.declaration.feature_tolerance import KINDS as DECLARED_KINDS, GeometricTolerance
from tolcontact.declaration.size import Size
from tolcontact.declaration.written_tolerance import TextFault, tolerance_class
from tolcontact.features.tolerance_kinds import is_drawn
from tolcontact.pmi.annotations import DatumReference, Dimension, Tolerance
from tolcontact.pmi.modifiers import OF_DATUMS, OF_TOLERANCES, Modifier

_KINDS = {
    "surface profile": declared.Profile, "circular runout": declared.CircularRunout, "total runout": declared.TotalRunout,
    "concentricity": declared.Coaxiality,
}  # fmt: skip
_ROUND_ZONES = ("cylindrical or circular", "within a cylinder", "within a circle", "spherical", "within a sphere")
_DIGITS = 9  # of sizes [mm] after the point
MAX_SIZE_DIFFERENCE = 1.0  # in widths of the limits: between them and the size of the shape


class Undeclared(Exception):
    """An annotation that no feature can state; the message is the reason."""


def tolerance(stated: Tolerance, *, is_axis: bool) -> GeometricTolerance:
    """Return a tolerance of a feature, with or without an axis, as it is declared. Raises Undeclared with the reason."""
    kind = _KINDS.get(stated.kind) or DECLARED_KINDS.get(stated.kind)
    if kind is None:
        raise Undeclared("its kind is not stated" if not stated.kind else f"features do not declare its kind, {stated.kind}")
    if stated.value is None:
        raise Undeclared("its value is not stated")
    if stated.maximum is not None:
        raise Undeclared("its value has an upper bound, which zones do not have")
    options = _options(stated)
    has_zone = "zone" in kind.options
    if is_axis and has_zone and stated.zone not in _ROUND_ZONES:
        raise Undeclared("its zone is flat, and the file does not state across which direction")
    is_lower = stated.refines is not None  # the lower segments of a composite frame lock directions alone
    system = "|".join(_compartment(reference, is_turned=is_lower) for reference in stated.datums)
    if (kind.is_form and not is_drawn(kind, options.get("per"))) or not (kind.is_form or kind.needs_datums or system):
        options["form"] = None  # a profile without datums may be of any surface
    if "(" not in system:
        options.pop("simultaneous", None)  # nothing is shared or separate
    result = kind(stated.value, system, **options)
    if not system and kind.needs_datums and kind is not declared.Position:  # which members of a pattern may have
        raise Undeclared("it needs datums, and the file states none")
    for fault in result.faults():
        raise Undeclared(fault)
    return result


def _options(stated: Tolerance) -> dict[str, Any]:
    """Return the options of a declared tolerance by their names. Raises Undeclared for modifiers that are none."""
    options: dict[str, Any] = {"projected": stated.projected, "outside": stated.displacement}
    for modifier in stated.modifiers:
        options |= _declared(modifier, OF_TOLERANCES, "of a declared tolerance")
    if stated.per_unit:
        options["per"] = stated.per_unit if len(stated.per_unit) > 1 else stated.per_unit[0]
    return options


def _compartment(reference: DatumReference, *, is_turned: bool) -> str:
    """Return a place of a datum system as it is declared; with `is_turned` it locks directions alone."""
    letters, marks = "-".join(reference.letters), {"><"} if is_turned else set[str]()
    try:
        marks |= {_declared(modifier, OF_DATUMS, "of a declared datum")["mark"] for modifier in reference.modifiers}
    except Undeclared as reason:
        raise Undeclared(f"datum {letters}: {reason}") from reason
    return letters + "".join(sorted(marks))  # "(M)" comes before "><"


def _declared(modifier: str, table: Mapping[str, Modifier], of_what: str) -> dict[str, Any]:
    """Return how a modifier is declared. Raises Undeclared with the reason and the standard if it is not."""
    if modifier not in table:
        raise Undeclared(f"its modifier, {modifier}, is not one {of_what}")
    entry = table[modifier]
    if isinstance(entry.declared, str):
        raise Undeclared(f"its modifier, {modifier} ({entry.sign}, {entry.standard}): {entry.declared}")
    return entry.declared


def size(stated: Dimension, nominal: float, *, is_inner: bool) -> Size:
    """Return the size of a shape of `nominal` size [mm], with the limits of a dimension about it.

    Raises Undeclared with the reason.
    """
    lower, upper = _limits(stated, nominal, is_inner)
    if not lower < upper:
        raise Undeclared(f"its limits {lower:g} and {upper:g} leave no width")
    if not lower - MAX_SIZE_DIFFERENCE * (upper - lower) <= nominal <= upper + MAX_SIZE_DIFFERENCE * (upper - lower):
        raise Undeclared(f"its limits are {lower:.6g} to {upper:.6g}, and the size of the shape is {nominal:.6g}")
    middle = round(nominal, _DIGITS)  # the kernel's numbers differ from the file's in their last digits
    return Size(middle, round(upper - middle, _DIGITS), round(lower - middle, _DIGITS))


def _limits(stated: Dimension, nominal: float, is_inner: bool) -> tuple[float, float]:
    """Return the limits of a size [mm], from its dimension or else from its tolerance class. Raises Undeclared."""
    factor = 2.0 if "radius" in stated.name else 1.0
    if stated.lower is not None and stated.upper is not None:
        if stated.unit != "mm":
            raise Undeclared("it is an angle")
        return factor * stated.lower, factor * stated.upper
    if not stated.fit:
        raise Undeclared("its limits are not stated")
    basis = nominal if stated.nominal is None else factor * stated.nominal
    try:
        fit = tolerance_class("".join(stated.fit.split()[:1]))
        lower, upper = fit.deviations(basis) if fit else (math.nan, math.nan)
    except TextFault as error:
        raise Undeclared(str(error)) from error
    if fit is None:
        raise Undeclared(f"its fit {stated.fit} is no tolerance class of ISO 286-1")
    if fit.is_hole != is_inner:
        kinds = ("a hole", "a shaft") if fit.is_hole else ("a shaft", "a hole")
        raise Undeclared(f"its fit {stated.fit} is for {kinds[0]}, and the feature is {kinds[1]}")
    return basis + lower, basis + upper
