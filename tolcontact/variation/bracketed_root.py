"""The root of a function between two places, by Brent's method. SciPy's takes the same steps, but takes long to import."""

from collections.abc import Callable, Sequence

RELATIVE_TOLERANCE = 2.0**-50  # of a root


def bracketed_root(function: Callable[[float], float], lower: float, upper: float, tolerance: float) -> float:
    """Return a root of a continuous function, to within a tolerance, between two places where it has opposite signs.

    A line through the last two places, or an inverse parabola through three, gives the next place, unless halving the interval
    is surer (R. Brent, Algorithms for Minimization without Derivatives, 1973). Raises ValueError if the signs are equal.
    """
    last, best = lower, upper
    last_value, best_value = function(last), function(best)
    if last_value * best_value > 0:
        raise ValueError(f"{last_value:g} and {best_value:g} at both ends; expected opposite signs")
    if last_value == 0:
        return last
    opposite, opposite_value, step, earlier_step = last, last_value, 0.0, 0.0
    while True:
        if last_value != 0 and best_value != 0 and (last_value > 0) != (best_value > 0):
            opposite, opposite_value, step, earlier_step = last, last_value, best - last, best - last
        if abs(opposite_value) < abs(best_value):
            last, best, opposite = best, opposite, best
            last_value, best_value, opposite_value = best_value, opposite_value, best_value
        least_step, half = (tolerance + RELATIVE_TOLERANCE * abs(best)) / 2, (opposite - best) / 2
        if best_value == 0 or abs(half) < least_step:
            return best
        places, values = (last, best, opposite), (last_value, best_value, opposite_value)
        is_closing_in = abs(earlier_step) > least_step and abs(best_value) < abs(last_value)
        trial = _interpolation(places, values) if is_closing_in else 0.0
        if is_closing_in and 2 * abs(trial) < min(abs(earlier_step), 3 * abs(half) - least_step):
            earlier_step, step = step, trial
        else:
            earlier_step = step = half
        last, last_value = best, best_value
        best += step if abs(step) > least_step else least_step if half > 0 else -least_step
        best_value = function(best)


def _interpolation(places: Sequence[float], values: Sequence[float]) -> float:
    """Return the step from the second of three places, of which the first and last may be one, to the root."""
    last, best, opposite = places
    last_value, best_value, opposite_value = values
    if last == opposite:
        return -best_value * (best - last) / (best_value - last_value)
    last_slope, opposite_slope = (last_value - best_value) / (last - best), (opposite_value - best_value) / (opposite - best)
    change = opposite_value * opposite_slope - last_value * last_slope
    return -best_value * change / (opposite_slope * last_slope * (opposite_value - last_value))
