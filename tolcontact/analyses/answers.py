"""Answers of growing accuracy: an analysis that is stopped, or whose time ends, leaves its latest answer, which says so.

An analysis is a sequence of answers. The first ones take little time, and the last one is complete. Each is a function that
makes the answer from what is known when it is called, so an answer that nobody asks for takes no time.
"""

import logging
import math
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import xarray as xr

from tolcontact import interrupts, vocabulary as terms
from tolcontact.errors import OptionError
from tolcontact.report import brief_lines

LONG = 30_000  # realizations at most: with more to come, answers are shown on the way
NEXT_LOOK, MIN_LOOK = 2.0, 20.0  # an answer is shown when this many times the time of the previous one has passed; at least [s]
MIN_STAGE, MIN_BASE = 500, 4  # realizations of the first stage, and its base realizations

log = logging.getLogger(__name__)


class Answer(NamedTuple):
    """The answer of an analysis.

    values      array for each variable of the record
    labels      labels of dimensions that are neither in the vocabulary nor in the model
    attributes  in addition to the title and the settings
    coarse      what the answer rests on, in words, if it is not complete
    units       units of the only measure, where no dimension lists measures
    """

    values: Mapping[str, Any]
    labels: Mapping[str, Sequence[str]]
    attributes: Mapping[str, Any]
    coarse: str = ""
    units: str | None = None


class Stopped(KeyboardInterrupt):
    """The user stopped an analysis that already had an answer, its `dataset`.

    `try: tc.analyses.tails("model.py")`, then `except tc.analyses.Stopped as stop: print(stop.dataset.probability)`
    """

    def __init__(self, dataset: xr.Dataset) -> None:
        super().__init__(dataset.attrs[terms.COARSE])
        self.dataset = dataset


class OutOfTime(Exception):
    """The time of an analysis has ended."""


class Answers:
    """The latest answer of an analysis, and the time that is left.

    dataset_of  makes the dataset of an answer
    minutes     time of the analysis; without an answer by then it continues to the first one
    """

    def __init__(self, record: terms.AnalysisRecord, dataset_of: Callable[[Answer], xr.Dataset], minutes: float | None) -> None:
        if minutes is not None and not (isinstance(minutes, int | float) and 0 < minutes < math.inf):
            raise OptionError(f"minutes is {minutes!r}; expected a positive number")
        self._record, self._dataset_of, self._minutes = record, dataset_of, minutes
        self._started = time.monotonic()
        self._next_look = 0.0
        self._latest: Callable[[], Answer] | None = None

    def last(self, answers: Iterable[Callable[[], Answer]]) -> xr.Dataset:
        """Return the dataset of the last answer, or of the latest when the time ends. Raises Stopped, see there."""
        try:
            for answer in answers:
                self._latest = answer
            assert self._latest is not None
            return self._dataset_of(self._latest()._replace(coarse=""))
        except OutOfTime:
            return self._coarse(f"{self._minutes:g} minutes have passed")
        except BaseException as error:
            if self._latest is None or not (isinstance(error, KeyboardInterrupt) or interrupts.is_stopping()):
                raise
            raise Stopped(self._coarse("stopped")) from None

    def check(self, total: int) -> None:
        """Show the latest answer now and then if an analysis simulates many realizations; raise OutOfTime when time is up."""
        if self._latest is None:
            return
        seconds = time.monotonic() - self._started
        if self._minutes is not None and seconds > 60 * self._minutes:
            raise OutOfTime
        if total > LONG and seconds >= self._next_look:
            for line in brief_lines(self._record, self._coarse("so far")):
                log.warning(line)
            self._next_look = max(NEXT_LOOK * (time.monotonic() - self._started), MIN_LOOK)

    def _coarse(self, reason: str) -> xr.Dataset:
        assert self._latest is not None
        answer = self._latest()
        return self._dataset_of(answer).assign_attrs({terms.COARSE: f"{reason}: {answer.coarse}"})


def stages(samples: int, size: int, *, first: int = 0) -> Iterator[tuple[int, int]]:
    """Yield first and last numbers of the base realizations of stages, each with as many as all before.

    size   realizations of each base realization
    first  base realizations of the first stage, if not the default
    """
    start, stop = 0, min(first or max(MIN_STAGE // size, MIN_BASE), samples)
    while start < samples:
        yield start, stop
        start, stop = stop, min(2 * stop, samples)
