"""Figures as people read them: an estimate with its interval, with as many decimals as that deserves."""

import math

import xarray as xr

MAX_DECIMALS = 6
MAX_DECIMALS_PERCENT = 2
RARE = 10_000  # ppm: from 1 % on shares are in percent


def grouped(count: int) -> str:
    """A count with its thousands apart: 57 344."""
    return f"{count:,}".replace(",", " ")


def limits_text(of: xr.Dataset) -> str:
    """The limits of a measure in words; empty if it has none."""
    lower, upper = float(of["measure_lower"].values), float(of["measure_upper"].values)
    if math.isfinite(lower) and math.isfinite(upper):
        return f"limits {lower:g} to {upper:g}"
    return f"at least {lower:g}" if math.isfinite(lower) else f"at most {upper:g}" if math.isfinite(upper) else ""


def number(values: object, *, sign: bool = False, most: int = MAX_DECIMALS) -> str:
    """`estimate [lower, upper]`, with as many decimals (`most` at most) as its width deserves; "-" if there is none."""
    estimate, lower, upper = (float(v) for v in values)  # type: ignore[attr-defined]
    if not math.isfinite(estimate):
        return "-"
    finite = [abs(bound - estimate) for bound in (lower, upper) if math.isfinite(bound)]
    width = max(finite, default=0.0)
    decimals = (
        min(max(_digits(width) - math.floor(math.log10(width)), 0), most)
        if width > 0
        else (0 if estimate == 0 else min(4, most))
    )
    plus = "+" if sign else ""
    return f"{_rounded(estimate, decimals):{plus}.{decimals}f} [{_bound(lower, decimals)}, {_bound(upper, decimals)}]"


def _digits(width: float) -> int:
    """One more digit if the first one of the half width is 1 or 2, so that rounding stays below a fifth of it."""
    return 1 if width / 10 ** math.floor(math.log10(width)) < 3 else 0


def percent(values: object, *, sign: bool = False) -> str:
    """`number` of shares, in percent."""
    estimate, lower, upper = (100 * float(v) for v in values)  # type: ignore[attr-defined]
    text = number((estimate, lower, upper), sign=sign, most=MAX_DECIMALS_PERCENT)
    return text if text == "-" else text.replace(" [", " % [")


def share(values: object) -> str:
    """`number` of shares, in percent; of rare events in ppm."""
    estimate, lower, upper = (1e6 * float(v) for v in values)  # type: ignore[attr-defined]
    if not math.isfinite(estimate) or estimate >= RARE:
        return percent(values)
    return f"{grouped(round(estimate))} ppm [{grouped(round(lower))}, {grouped(round(upper))}]"


def _bound(value: float, decimals: int) -> str:
    return f"{_rounded(value, decimals):.{decimals}f}" if math.isfinite(value) else ("-inf" if value < 0 else "inf")


def _rounded(value: float, decimals: int) -> float:
    """Rounded, and never -0."""
    return round(value, decimals) + 0.0
