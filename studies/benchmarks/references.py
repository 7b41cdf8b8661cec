"""Compute every expected value in two ways, with NumPy and SciPy alone: python -m studies.benchmarks.references [NAMES].

The exit code is 1 if one of them is not the stated value, within its tolerance. NumPy and SciPy suffice: empty modules
stand for what the models need, so that no expected value can come from it.
"""

import sys
from collections.abc import Iterator
from types import ModuleType

import numpy as np

from studies.benchmarks.problem import Problem, Quantity, problems

OF_MODELS = ("tolcontact", "casadi", "trimesh")


def recomputed(problem: Problem) -> Iterator[tuple[Quantity, float, float]]:
    """Yield each quantity with its values by `solution` and by `check`."""
    rows = zip(problem.quantities, problem.script.solution(), problem.script.check(), strict=True)
    yield from ((quantity, float(first), float(second)) for quantity, first, second in rows)


def is_confirmed(quantity: Quantity, *recomputed_values: float) -> bool:
    """Return whether all recomputed values are the stated one."""
    return bool(np.allclose(recomputed_values, quantity.expected, rtol=0, atol=quantity.tolerance))


def main() -> int:
    """Print stated and recomputed values, and return the exit code."""
    sys.modules |= {name: ModuleType(name) for name in OF_MODELS}
    are_confirmed = []
    for problem in problems(sys.argv[1:]):
        for quantity, *values in recomputed(problem):
            are_confirmed.append(is_confirmed(quantity, *values))
            numbers = "  ".join(f"{value:.10g}" for value in (quantity.expected, *values))
            print(f"{'ok   ' if are_confirmed[-1] else 'WRONG'} {problem.name}: {quantity.label}  {numbers}", flush=True)
    print(f"{sum(are_confirmed)} of {len(are_confirmed)} expected values are confirmed in two ways")
    return int(not all(are_confirmed))


if __name__ == "__main__":
    sys.exit(main())
