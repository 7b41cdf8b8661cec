"""Archives side by side: of other designs, tolerances or methods, with the same draws or not."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import xarray as xr

from tolcontact.archive import check_rows, open_archive
from tolcontact.errors import OptionError
from tolcontact.statistics import compare_runs as statistics_of


def compare_runs(runs: Mapping[str, xr.DataTree] | Sequence[str | Path]) -> xr.Dataset:
    """How runs differ from the first one (see tolcontact.statistics.compare_runs): results by their names, or archives.

    Raises ArchiveError for an archive that is missing or damaged, OptionError for fewer than two, or nothing in common.
    """
    if isinstance(runs, str | Path):
        runs = [runs]
    if not isinstance(runs, Mapping):
        with ExitStack() as stack:
            return compare_runs({name: stack.enter_context(open_archive(path)) for name, path in named(runs).items()})
    if len(runs) < 2:
        raise OptionError("a comparison is of two runs or more; name another one")
    for name, run in runs.items():
        if not isinstance(run, xr.DataTree):
            raise OptionError(f'run "{name}" is a {type(run).__name__}; expected what tc.run or tc.open_archive returns')
        check_rows(run)
    return statistics_of(runs)


def named(paths: Sequence[str | Path]) -> dict[str, Path]:
    """Archives by the shortest names that tell them apart: stems, names, or paths. Raises OptionError for one given twice."""
    files = [Path(path) for path in paths]
    for name in (lambda path: path.stem, lambda path: path.name, str):
        found = {name(path): path for path in files}
        if len(found) == len(files):
            return found
    raise OptionError(f"archives are {', '.join(map(str, files))}; name each once")
