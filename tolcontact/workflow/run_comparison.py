"""Comparison of archives: other designs, tolerances or methods, on the same draws or on others."""

from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path

import xarray as xr

from tolcontact.archive import check_rows, open_archive
from tolcontact.errors import OptionError
from tolcontact.statistics import compare_runs as compare_results


def compare_runs(runs: Mapping[str, xr.DataTree] | Sequence[str | Path]) -> xr.Dataset:
    """Compare runs with the first one (see tolcontact.statistics.compare_runs): results by name, or paths of archives.

    Raises ArchiveError for a missing or damaged archive, and OptionError for fewer than two runs or for runs
    without a common measure.
    """
    if isinstance(runs, str | Path):
        runs = [runs]
    if not isinstance(runs, Mapping):
        with ExitStack() as stack:
            return compare_runs({name: stack.enter_context(open_archive(path)) for name, path in named_archives(runs).items()})
    if len(runs) < 2:
        raise OptionError("a comparison needs at least two runs; name another one")
    for name, run in runs.items():
        if not isinstance(run, xr.DataTree):
            raise OptionError(f'run "{name}" is a {type(run).__name__}; expected what tc.run or tc.open_archive returns')
        check_rows(run)
    return compare_results(runs)


def named_archives(paths: Sequence[str | Path]) -> dict[str, Path]:
    """Return archives by the shortest names that distinguish them: stems, file names, or paths.

    Raises OptionError for an archive that is named twice.
    """
    files = [Path(path) for path in paths]
    for name in (lambda path: path.stem, lambda path: path.name, str):
        archives = {name(path): path for path in files}
        if len(archives) == len(files):
            return archives
    raise OptionError(f"archives are {', '.join(map(str, files))}; name each once")
