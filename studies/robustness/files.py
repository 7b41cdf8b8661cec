"""Give commands files of strangers: rotten archives, rotten shapes, models as JSON that ask for too much.

python -m studies.robustness.files --archives 500 --shapes 200 --models 100 --steps 200 --hostile-steps 80 --seed 0
"""

import argparse
import contextlib
import copy
import itertools
import json
import random
import shutil
import tempfile
from pathlib import Path
from typing import Any

import netCDF4
import trimesh

import tolcontact as tc
from studies.robustness.attempts import Ending, Table, attempt, contents
from studies.robustness.step_texts import damaged, hostile
from tests.hostile import HOSTILE
from tolcontact.geometry.files import ReadingLimits

ROOT = Path(__file__).resolve().parents[2]
MODELS = ("ra1", "channel")
READERS = {
    "summary": ["summary", "a.nc"],
    "summary --json": ["summary", "a.nc", "--json"],
    "summary --csv": ["summary", "a.nc", "--csv"],
    "summary --limits": ["summary", "a.nc", "--limits"],
    "report": ["report", "a.nc", "--overwrite"],
    "compare": ["compare", "good.nc", "a.nc"],
    "run --resume": ["run", "MODEL", "--samples", "40", "--solver", "daqp", "--out", "a.nc", "--resume", "--quiet"],
}
MAX_SECONDS, MAX_MEGABYTES = 20.0, 2048.0  # for the model of a stranger
STEP_COMMANDS = (["bodies"], ["faces"], ["pmi"])
MAX_STEP_MEGABYTES = 6 * 1024.0  # for a STEP file


def changed(data: bytes, rng: random.Random) -> bytes:
    """Return bytes with some changed, cut off, blank, repeated or added."""
    kind, rotten = rng.randrange(6), bytearray(data)
    start = rng.randrange(len(data))
    length = rng.randint(1, max(1, len(data) // 10))
    if kind in (0, 1):
        for _ in range(rng.choice((1, 3, 20, 200))):
            rotten[rng.randrange(len(rotten))] = rng.randrange(256)
    elif kind == 2:
        del rotten[start:]
    elif kind == 3:
        rotten[start : start + length] = bytes(len(rotten[start : start + length]))
    elif kind == 4:
        rotten[start:start] = rotten[:length]
    else:
        del rotten[start : start + length]
    return bytes(rotten)


def archives(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Let every reader read archives with changed bytes, or with one or two lies."""
    said = {}
    for name in MODELS:
        model = ROOT / f"models/{name}.py"
        tc.run(model, samples=40, solver="daqp", out=folder / f"{name}.nc").close()
        shutil.copy(folder / f"{name}.nc", folder / "good.nc")
        shutil.copy(folder / f"{name}.nc", folder / "a.nc")
        said[name] = {reader: attempt(words(reader, model), folder).out for reader in READERS}
    for number in range(count):
        name = rng.choice(MODELS)
        path, good = folder / "a.nc", folder / f"{name}.nc"
        shutil.copy(good, folder / "good.nc")
        shutil.copy(good, path)
        if number % 3:
            path.write_bytes(changed(good.read_bytes(), rng))
            what = "bytes changed"
        else:
            what = " and ".join(rng.sample(list(HOSTILE), rng.choice((1, 1, 2))))
            try:
                with netCDF4.Dataset(path, "r+") as file:
                    for lie in what.split(" and "):
                        HOSTILE[lie](file)
            except Exception:  # lies that exclude each other, or that this model has no place for
                what += " (in part)"
        before = path.read_bytes()
        for reader in READERS:
            path.write_bytes(before)
            ending = attempt(words(reader, ROOT / f"models/{name}.py"), folder)
            fault = ending.fault
            if not fault and ending.code != 2 and reader != "run --resume" and number % 3:
                same = ending.out.replace("a.html", "") == said[name][reader].replace("a.html", "")
                fault = "" if same else "says something else"
            if not fault and ending.code == 2 and path.read_bytes() != before:
                fault = "changed a file that it refused"
            kept = fault or ("refused" if ending.code == 2 else "says what it said" if number % 3 else "accepted")
            table.add(f"archives: {reader}", kept, f"{number} {name} {what}: {ending.error[-600:]}", is_fault=bool(fault))


def words(reader: str, model: Path) -> list[str]:
    return [str(model) if word == "MODEL" else word for word in READERS[reader]]


def shapes(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Let commands read shape files with changed bytes."""
    box = trimesh.creation.box((50, 25, 10)).subdivide().subdivide()
    box.apply_translation((25, 12.5, 5))
    good = {f"box.{kind}": box.export(file_type=kind) for kind in ("stl", "obj", "ply", "glb")}
    good = {name: data.encode() if isinstance(data, str) else data for name, data in good.items()}
    good["as1.stp"] = (ROOT / "studies/cad/as1-oc-214.stp").read_bytes()
    for number in range(count):
        name = rng.choice(list(good))
        (folder / name).write_bytes(changed(good[name], rng))
        if name.endswith(".stp"):
            command = rng.choice((["bodies", name], ["faces", name, "--body", "1"], ["view", name, "--out", "v.html"]))
        else:
            document = stand()
            document["parts"][1]["geometry"] = {"file": name, "units": "mm"}
            (folder / "m.json").write_text(json.dumps(document))
            command = ["check", "m.json"]
        ending = attempt(command, folder, limit=400)
        kept = ending.fault or ("refused" if ending.code == 2 else "read")
        table.add(
            f"shapes: {name.rpartition('.')[2]}",
            kept,
            f"{number} {command}: {ending.error[-600:]}",
            is_fault=bool(ending.fault),
        )


def steps(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Let commands read a STEP file of 53 kB that is damaged at random."""
    sound = (ROOT / "models/cover.step").read_bytes()
    for number in range(count):
        kind, content = damaged(sound, rng)
        _try_step(f"STEP files, {kind}", str(number), folder / "cover.step", content, table)


def hostile_steps(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Let commands read STEP files that are hostile on purpose."""
    for kind, name, content in itertools.islice(hostile((ROOT / "models/cover.step").read_bytes()), count):
        _try_step("STEP files, hostile", kind, folder / name, content, table)


def _try_step(group: str, kind: str, path: Path, content: bytes, table: Table) -> None:
    path.write_bytes(content)
    for command, *options in STEP_COMMANDS:
        ending = attempt([command, *options, "--", path.name], path.parent, limit=3600)
        fault = ending.fault or _step_fault(ending, len(content) / 1e6)
        words = f"{kind}, {command}: {ending.seconds:.1f} s, {ending.megabytes:.0f} MiB: {ending.error[-500:]}"
        table.add(group, fault or ("refused" if ending.code == 2 else "read"), words, is_fault=bool(fault))
    path.unlink()


def _step_fault(ending: Ending, megabytes: float) -> str:
    """Return what is wrong with the ending of a command that reads a STEP file; empty if nothing is."""
    limits = ReadingLimits()
    if ending.code == 1 or (ending.code == 2 and ending.error.count("error: ") != 1):
        return "not one message"
    if ending.seconds > 2 * (limits.seconds + limits.seconds_per_mb * megabytes) + 10:  # it is tried twice
        return "took too long"
    return "took too much memory" if ending.megabytes > MAX_STEP_MEGABYTES else ""


def stand() -> dict[str, Any]:
    """Return a small model."""
    faces = [{"part": "block", "select": [way]} for way in ("-z", "-y", "-x")]
    seat = {"name": "seat", "moving": {"part": "block", "select": ["-z"]}, "reference": {"part": "table", "select": ["+z"]}}
    return {
        "name": "stand",
        "parts": [
            {"name": "table", "geometry": {"box": [100, 50, 10]}, "fixed": True},
            {"name": "block", "geometry": {"box": [50, 25, 10]}, "at": [50, 12.5, 10]},
        ],
        "locations": [{"part": "block", "tolerance": 1, "scheme": {"three_two_one": faces, "inset": 5}}],
        "pairs": [seat],
        "measures": [{"name": "height", "of": {"part": "block", "position": [50, 0, 10]}, "along": "z", "tolerance": 1}],
    }


STRANGE: tuple[Any, ...] = (
    None, True, -1, 0, 1e308, 10**400, 1e-300, 1e-9, 10**9, 1e5, "", "x", "a" * 10**6, [], {}, [0, 0, 0], [1e300] * 3, "block",
    {"scipy": "studentized_range", "args": [3, 10]}, {"scipy": "levy_stable", "args": [1.8, 0.5]},
    {"scipy": "ksone", "args": [22]}, {"scipy": "kappa4", "args": [1, 0]}, {"box": [1e-9, 1, 1]},
    {"box": [1e9, 1e9, 1e9]}, "vertices", [[1, 2], [3, 4]],
)  # fmt: skip


def many(document: dict[str, Any], rng: random.Random) -> None:
    """Repeat an entry of a list very often, under other names."""
    key, times = rng.choice(("parts", "locations", "pairs", "measures")), rng.choice((50, 500, 5000, 100_000))
    for number in range(times):
        entry = copy.copy(document[key][-1])
        if "name" in entry:
            entry["name"] = f"{entry['name'][:20]} {number}"
        document[key].append(entry)


def strange_model(rng: random.Random) -> str:
    """Return a model as JSON in which some entries are strange, or very many."""
    document = stand()
    with contextlib.suppress(TypeError, KeyError, IndexError, AttributeError):  # the first change may forbid a second one
        _make_strange(document, rng, changes=rng.choice((1, 1, 2)))
    text = json.dumps(document)
    return text if rng.random() < 0.9 else changed(text.encode(), rng).decode(errors="replace")


def _make_strange(document: dict[str, Any], rng: random.Random, changes: int) -> None:
    for _ in range(changes):
        kind = rng.random()
        if kind < 0.2:
            many(document, rng)
        elif kind < 0.3:
            document["pairs"][0][rng.choice(("points", "spacing", "within"))] = rng.choice((10**5, 10**9, 1e-9, 0.01, 1e9))
        elif kind < 0.4:
            steps = rng.choice((10, 10**4, 10**5, 10**6))
            tape = [["input", 3], *(["sin", k] for k in range(steps))]
            document["measures"].append({"name": "turn", "tape": tape, "units": "1"})
        else:
            at: Any = document
            while True:
                key = rng.choice(list(at) if isinstance(at, dict) else range(len(at)))
                if isinstance(at[key], dict | list) and at[key] and rng.random() < 0.8:
                    at = at[key]
                    continue
                at[key] = rng.choice(STRANGE)
                break


def models(count: int, rng: random.Random, folder: Path, table: Table) -> None:
    """Run models as JSON of strangers."""
    for number in range(count):
        text = strange_model(rng)
        (folder / "m.json").write_text(text)
        before = contents(folder)
        ending = attempt(["run", "m.json", "--samples", "100"], folder, limit=200)
        fault = ending.fault
        if not fault and (ending.seconds > MAX_SECONDS or ending.megabytes > MAX_MEGABYTES):
            fault = "took too much"
        if not fault and contents(folder) != before:
            fault = "left files"
        took = f"{number}: {ending.seconds:.1f} s, {ending.megabytes:.0f} MiB, {len(text)} characters: "
        kept = fault or ("refused" if ending.code == 2 else "ran")
        table.add("models as JSON", kept, took + text[:300] + " ... " + ending.error[-500:], is_fault=bool(fault))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    for name in ("archives", "shapes", "models", "steps", "hostile_steps"):
        parser.add_argument(f"--{name.replace('_', '-')}", type=int, default=0)
    parser.add_argument("--seed", type=int, default=0)
    options, table = parser.parse_args(), Table()
    for kind in (archives, shapes, models, steps, hostile_steps):
        with tempfile.TemporaryDirectory() as folder:
            kind(getattr(options, kind.__name__), random.Random(options.seed), Path(folder), table)
    print("\n".join(table.lines()))


if __name__ == "__main__":
    main()
