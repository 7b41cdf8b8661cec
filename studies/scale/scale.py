"""What a cluster costs: throughput with threads and workers, bytes, start; and what a large one would be limited by.

    python -m studies.scale.scale [--samples 1000000] [--kills 20]

Everything is measured in one run. A large cluster is simulated with these costs: workers that simulate shards, a network
between them and one writer, a scheduler that serves tasks one by one, a writer that takes shards in order.
"""

import argparse
import heapq
import os
import random
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil
import xarray as xr

import tolcontact as tc
from models import cells, ra1, ra2
from tolcontact.simulation.cluster import MAX_SHARD_ROWS, SHARDS_AHEAD, local_cluster

VARYING = ("summed_rows", "sums")
TASK = 1e-3  # s that a scheduler takes for a task, of dask's own documentation: 200 us to 1 ms
NETWORK = 1.25e9  # bytes/s of 10 Gbit/s


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--samples", type=int, default=1_000_000)
    parser.add_argument("--kills", type=int, default=20)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "run.nc"
        throughput(tc.build(ra1.assembly, solver="daqp"), given.samples, path)
        large(throughput(tc.build(ra2.assembly, solver="daqp"), given.samples, path))
        slow = tc.build(cells.assembly, solver="daqp", method={"resolution": "exact"})
        throughput(slow, given.samples // 10, path, keep="measures", fields="none")
        memory(10 * given.samples, path)
        kills(given.kills, given.kills // 2, Path(folder))


def throughput(program, samples, path, **kept):
    """Realizations a second, medians of three; returns costs of a realization: of a worker and the writer [s], and bytes."""
    options = {"out": path, "overwrite": True, "surfaces": 0, **kept}
    tc.run(program, samples=10_000, **options).close()
    size = path.stat().st_size
    tc.run(program, samples=samples, **options).close()
    size = (path.stat().st_size - size) / (samples - 10_000)
    print(f"\n{program.nominal.assembly.name}: {size:.0f} bytes a realization")

    def rate(client):
        began = time.perf_counter()
        tc.run(program, samples=samples, client=client, **options).close()
        return samples / (time.perf_counter() - began)

    rates, spent = {}, {}
    for workers in (1, 2):
        began = time.perf_counter()
        with local_cluster(workers) as client:
            started = time.perf_counter() - began
            began = time.perf_counter()
            tc.run(program, samples=5000, client=client, **options).close()
            first = time.perf_counter() - began
            rate(client)
            threads, rates[workers] = np.median([(rate(None), rate(client)) for _ in range(3)], axis=0)
            own = processor_times()
            rate(client)
            spent[workers] = (processor_times() - own) / samples
            began = time.perf_counter()
            tc.simulate(program, samples).to_zarr(path.with_suffix(".zarr"), mode="w")
            apart = samples / (time.perf_counter() - began)
        print(
            f"  two threads {threads:,.0f}, {workers} workers {rates[workers]:,.0f} a second; cluster up in {started:.1f} s, "
            f"first 5000 in {first:.1f} s; processor time of one: writer {spent[workers][0] * 1e6:.1f} us, "
            f"workers {spent[workers][1] * 1e6:.1f} us; to zarr, without a writer, {apart:,.0f} a second"
        )
    print(f"  two workers to one {rates[2] / rates[1]:.2f}, to two threads {rates[2] / threads:.2f}")
    return spent[1][1], spent[1][0], size


def memory(samples, path):
    """Of client and workers [MB], from a tenth of a long run on."""
    program, own = tc.build(ra1.assembly, solver="daqp"), psutil.Process()
    seen: list[list[int]] = []

    def look(rows):
        if rows >= samples // 10 * (len(seen) + 1):
            seen.append([each.memory_info().rss for each in (own, *sorted(own.children(recursive=True), key=lambda p: p.pid))])

    with local_cluster(2) as client:
        tc.run(
            program, samples=samples, out=path, client=client, progress=look,
            keep="measures", surfaces=0, fields="none", overwrite=True,
        ).close()  # fmt: skip
    low, high = np.min(seen, axis=0) / 1e6, np.max(seen, axis=0) / 1e6
    print(f"\nmemory over {samples:.0e} realizations of RA1, of the client and its processes [MB]:")
    print("  " + ", ".join(f"{one:.0f} to {other:.0f}" for one, other in zip(low, high, strict=True)))


def processor_times():
    """Of this process, and of its workers [s]."""
    own = psutil.Process()
    return np.array([sum(own.cpu_times()[:2]), sum(sum(each.cpu_times()[:2]) for each in own.children(recursive=True))])


def large(costs, samples=1_000_000_000):
    """How long so many realizations take on clusters, and what is busy how much of the time."""
    of_worker, of_writer, size = costs
    said = f"worker {of_worker * 1e6:.1f} us, writer {of_writer * 1e6:.1f} us, {size:.0f} bytes"
    print(f"\n{samples:.0e} realizations, by the costs of one: {said}")
    for workers in (1, 10, 100, 1000):
        for writers in (1, 16):
            if writers > workers:
                continue
            seconds, busy = simulated(workers, writers, samples, of_worker, of_writer, size)
            said = ", ".join(f"{name} {100 * share:.0f} %" for name, share in busy.items())
            print(f"  {workers:5d} workers, {writers:2d} archives: {seconds / 3600:7.2f} h; busy: {said}")


def simulated(workers, writers, samples, of_worker, of_writer, size):
    """Hours of one of the archives, which each have workers and a writer of their own, and share scheduler and network."""
    count, own = samples // MAX_SHARD_ROWS // writers, workers // writers
    lot, free = np.random.default_rng(1), [0.0] * own
    ready: list[float] = []
    written: list[float] = []
    scheduler = wire = 0.0
    for shard in range(count):
        while len(ready) < min(count, shard + SHARDS_AHEAD * own):
            begun = len(ready) - SHARDS_AHEAD * own
            scheduler = max(scheduler, written[begun] if begun >= 0 else 0.0) + TASK * writers
            start = max(heapq.heappop(free), scheduler)
            ready.append(start + MAX_SHARD_ROWS * of_worker * lot.uniform(0.9, 1.1))
            heapq.heappush(free, ready[-1])
        wire = max(wire, ready[shard]) + MAX_SHARD_ROWS * size * writers / NETWORK
        written.append(max(written[-1] if written else 0.0, wire) + MAX_SHARD_ROWS * of_writer)
    rows = count * MAX_SHARD_ROWS
    busy = {
        "workers": rows * of_worker / own,
        "writer": rows * of_writer,
        "network": rows * size * writers / NETWORK,
        "scheduler": count * TASK * writers,
    }
    return written[-1], {name: seconds / written[-1] for name, seconds in busy.items()}


def kills(of_workers, of_writers, folder):
    """Compare runs whose worker or writer is killed at a random instant with an undisturbed run."""
    whole = folder / "whole.nc"
    tc.run(ra1.assembly, samples=120_000, solver="daqp", surfaces=4, out=whole).close()
    lot, equal = random.Random(1), 0
    with local_cluster(2) as client:
        for _ in range(of_workers):
            at = lot.randrange(1, 100_000)
            killed: list[int] = []

            def kill(rows, at=at, killed=killed):
                if rows >= at and not killed:
                    killed.append(lot.choice(list(client.run(os.getpid).values())))
                    os.kill(killed[0], signal.SIGKILL)

            path = folder / "killed.nc"
            tc.run(
                ra1.assembly, samples=120_000, solver="daqp", surfaces=4, out=path, overwrite=True, client=client, progress=kill
            ).close()
            equal += same(path, whole)
    print(f"\na worker killed at a random instant: {equal} of {of_workers} runs equal to the last bit")
    equal, left, command = (
        0,
        0,
        [sys.executable, "-m", "tolcontact", "run", ra1.__file__, "--solver", "daqp", "--surfaces", "4"],
    )
    for number in range(of_writers):
        path = folder / f"writer{number}.nc"
        options = [*command, "--samples", "120000", "--quiet", "--out", str(path)]
        begun = subprocess.Popen([*options, "--workers", "2"], stdout=subprocess.DEVNULL)
        while not path.exists():
            time.sleep(0.05)
        time.sleep(lot.uniform(0.0, 1.2))
        children = psutil.Process(begun.pid).children(recursive=True)
        begun.kill()
        begun.wait()
        left += len(psutil.wait_procs(children, timeout=20)[1])
        subprocess.run([*options, "--resume", "--workers", str(1 + number % 3)], check=True, stdout=subprocess.DEVNULL)
        equal += same(path, whole)
    print(f"the writer killed at a random instant, resumed with 1 to 3 workers: {equal} of {of_writers} equal; {left} left")


def same(path, whole):
    with xr.open_datatree(path) as one, xr.open_datatree(whole) as other:
        pairs = [
            (one[group].dataset[name], values)
            for group in other.groups
            for name, values in other[group].data_vars.items()
            if name not in VARYING
        ]
        return all(np.array_equal(a.values, b.values, equal_nan=b.dtype.kind == "f") for a, b in pairs)


if __name__ == "__main__":
    main()
