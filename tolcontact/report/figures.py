"""Figures for readers: an estimate with its interval, rounded to the digits that the interval supports."""

import math

import xarray as xr

from tolcontact.limits import GAP_ACCURACY

MAX_DECIMALS = 6
MAX_DECIMALS_PERCENT = 2
NO_INTERVAL = "[-]"
PERCENT_FROM = 10_000  # ppm; smaller shares are in ppm
NOISE = 1e-5  # of the scale of a declared value: smaller differences from a shorter text are rounding


def grouped(count: int) -> str:
    """Return a count with grouped thousands: 57 344."""
    return f"{count:,}".replace(",", " ")


def plain(value: float, scale: float | None = None) -> str:
    """Return a declared value with the fewest decimals within `NOISE` of its scale; "" without a value.

    The scale is the width of the limits, or by default the size of the value.
    """
    if not math.isfinite(value):
        return ""
    allowed = NOISE * (scale or abs(value))
    decimals = next((d for d in range(MAX_DECIMALS + 1) if abs(round(value, d) - value) <= allowed), None)
    return f"{value:.6g}" if decimals is None else f"{_rounded(value, decimals):.{decimals}f}"


def nominal_and_limits(nominal: float, lower: float, upper: float) -> tuple[str, str, str]:
    """Return a nominal value and its limits, which may be infinite, with decimals that suit the width of the limits."""
    known = [abs(value) for value in (nominal, lower, upper) if math.isfinite(value)]
    scale = upper - lower if math.isfinite(upper - lower) else max(known, default=None)
    return plain(nominal, scale), plain(lower, scale), plain(upper, scale)


def settled(penetration: float) -> float:
    """Return a penetration [mm], or 0 where it is rounding."""
    return penetration if penetration > GAP_ACCURACY else 0.0


def limits_text(measure: xr.Dataset) -> str:
    """Return the limits of a measure in words, and which of them are stops; empty without limits."""
    lower, upper = float(measure["measure_lower"].values), float(measure["measure_upper"].values)
    stops = str(measure["measure_stops"].values) if "measure_stops" in measure.coords else ""
    note = f" ({stops} limit: a stop)" if stops else ""
    if math.isfinite(lower) and math.isfinite(upper):
        return f"limits {plain(lower, upper - lower)} to {plain(upper, upper - lower)}{note}"
    sides = (("at least", lower), ("at most", upper))
    return next((f"{words} {plain(limit)}{note}" for words, limit in sides if math.isfinite(limit)), "")


def number(values: object, *, sign: bool = False, max_decimals: int = MAX_DECIMALS) -> str:
    """Return `estimate [lower, upper]` with the decimals that its width supports; "-" without an estimate.

    An estimate without an interval has two significant digits, and says so.
    """
    estimate, lower, upper = (float(v) for v in values)  # type: ignore[attr-defined]
    if not math.isfinite(estimate):
        return "-"
    if math.isnan(lower) and math.isnan(upper):
        decimals = 1 - math.floor(math.log10(abs(estimate))) if estimate else 0
        return f"{_rounded(estimate, decimals):{'+' if sign else ''}.{max(decimals, 0)}f} {NO_INTERVAL}"
    finite = [abs(bound - estimate) for bound in (lower, upper) if math.isfinite(bound)]
    width = max(finite, default=0.0)
    decimals = (
        min(max(_digits(width) - math.floor(math.log10(width)), 0), max_decimals)
        if width > 0
        else (0 if estimate == 0 else min(4, max_decimals))
    )
    plus = "+" if sign else ""
    return f"{_rounded(estimate, decimals):{plus}.{decimals}f} [{_bound(lower, decimals)}, {_bound(upper, decimals)}]"


def _digits(width: float) -> int:
    """Return the number of digits, one more for a half width that begins with 1 or 2: rounding stays below a fifth of it."""
    return 1 if width / 10 ** math.floor(math.log10(width)) < 3 else 0


def percent(values: object, *, sign: bool = False) -> str:
    """Return `number` of a share, in percent."""
    estimate, lower, upper = (100 * float(v) for v in values)  # type: ignore[attr-defined]
    text = number((estimate, lower, upper), sign=sign, max_decimals=MAX_DECIMALS_PERCENT)
    return text if text == "-" else text.replace(" [", " % [")


def share(values: object) -> str:
    """Return `number` of a share, in percent, or in ppm if it is small."""
    estimate, lower, upper = (1e6 * float(v) for v in values)  # type: ignore[attr-defined]
    if not math.isfinite(estimate) or estimate >= PERCENT_FROM:
        return percent(values)
    return f"{grouped(round(estimate))} ppm [{grouped(round(lower))}, {grouped(round(upper))}]"


def _bound(value: float, decimals: int) -> str:
    return f"{_rounded(value, decimals):.{decimals}f}" if math.isfinite(value) else ("-inf" if value < 0 else "inf")


def _rounded(value: float, decimals: int) -> float:
    """Return a rounded value; it is never -0."""
    return round(value, decimals) + 0.0
