"""The draws of sensitivities: each realization as it is, and once with each column a step higher and lower."""

import numpy as np

from tolcontact.variation.draws import Draws


class SteppedDraws:
    """Deviations as Draws give them: realization k (1 + 2 columns) + m is realization k, with one column stepped for m > 0.

    First come the steps up of all `columns`, by `steps` (column,) in their units, then the steps down.
    """

    def __init__(self, draws: Draws, columns: np.ndarray, steps: np.ndarray) -> None:
        self._draws, self._columns, self._steps = draws, columns, steps

    @property
    def together(self) -> int:
        """How many realizations there are of each."""
        return 1 + 2 * len(self._columns)

    def __call__(self, *, seed: int, start: int, stop: int) -> np.ndarray:
        """Deviations (realization, contributor); see Draws."""
        first, last = start // self.together, -(-stop // self.together)
        own = self._draws(seed=seed, start=first, stop=last)
        every = np.repeat(own[:, None], self.together, axis=1)
        count = len(self._columns)
        for k, (column, step) in enumerate(zip(self._columns, self._steps, strict=True), start=1):
            every[:, k, column] += step
            every[:, count + k, column] -= step
        return every.reshape(-1, own.shape[1])[start - first * self.together : stop - first * self.together]
