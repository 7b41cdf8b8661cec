"""What worker processes cost: realizations a second with threads and workers, bytes and processor time of a realization.

    python -m studies.cost.cluster [--samples 1000000] [--to FOLDER]

Two threads and the workers take turns; rates are medians of three runs with an archive.
"""

import argparse
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
from distributed import Client

import tolcontact as tc
from models import cells, ra1, ra2
from studies.tables import write
from tolcontact.compilation import Program
from tolcontact.simulation.cluster import local_cluster

COLUMNS = (
    "model", "two threads [1/s]", "one worker [1/s]", "two workers [1/s]", "bytes", "worker [us]", "writer [us]",
)  # fmt: skip


def processor_times() -> np.ndarray:
    """Return the processor times of this process and of its workers [s]."""
    process = psutil.Process()
    return np.array([sum(process.cpu_times()[:2]), sum(sum(p.cpu_times()[:2]) for p in process.children(recursive=True))])


def row(program: Program, samples: int, path: Path, **kept) -> tuple[object, ...]:
    """Return the row of a model, by COLUMNS."""
    options = {"out": path, "overwrite": True, "surfaces": 0, **kept}

    def rate(client: Client | None, count: int = samples) -> float:
        start = time.perf_counter()
        tc.run(program, samples=count, client=client, **options).close()
        return count / (time.perf_counter() - start)

    few = samples // 100
    rate(None, few)
    size = path.stat().st_size
    rate(None)
    size = round((path.stat().st_size - size) / (samples - few))
    rates: dict[int, float] = {}
    for workers in (1, 2):
        with local_cluster(workers) as client:
            rate(client, few)
            threads, rates[workers] = np.median([(rate(None), rate(client)) for _ in range(3)], axis=0)
            start = processor_times()
            rate(client)
            writer, worker = 1e6 * (processor_times() - start) / samples
    per_second = (f"{value:,.0f}" for value in (threads, rates[1], rates[2]))
    return program.nominal.assembly.name, *per_second, size, f"{worker:.3g}", f"{writer:.3g}"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--to", type=Path, help="folder of the page")
    arguments = parser.parse_args()
    exact = tc.build(cells.assembly, solver="daqp", method={"resolution": "exact"})
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.nc"
        rows = [row(tc.build(model.assembly, solver="daqp"), arguments.samples, path) for model in (ra1, ra2)]
        rows.append(row(exact, arguments.samples // 10, path, keep="measures", fields="none"))
    write(__file__, {"cluster": [COLUMNS, *rows]}, arguments.to)


if __name__ == "__main__":
    main()
