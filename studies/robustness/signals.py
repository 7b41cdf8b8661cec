"""Send Ctrl-C and SIGTERM to commands at random instants: one signal has to end each, with its message and nothing else.

python -m studies.robustness.signals --tries 1000 --seed 0
"""

import argparse
import contextlib
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MODEL = str(ROOT / "models/ra1.py")
PATIENCE = 12.0  # s after the signal
COMMANDS = {
    "check": ["check", MODEL],
    "run": ["run", MODEL, "--samples", "3000000", "--surfaces", "0"],
    "run --out": ["run", MODEL, "--samples", "3000000", "--out", "run.nc"],
    "run --workers": ["run", MODEL, "--samples", "30000000", "--workers", "2", "--out", "run.nc"],
    "run --report": ["run", MODEL, "--samples", "20000", "--report", "run.html"],
    "compare": ["compare", MODEL, "--samples", "300000", "--solvers", "daqp,osqp"],
    "compare archives": ["compare", "a.nc", "b.nc", "--report", "both.html"],
    "contributions": ["contributions", MODEL, "--samples", "40000"],
    "sensitivities": ["sensitivities", MODEL, "--samples", "40000"],
    "tails": ["tails", MODEL, "--samples", "3000000"],
    "worst": ["worst", MODEL, "--samples", "300000"],
    "allocate --workers": ["allocate", MODEL, "--require", "corner height: ppm 10000", "--workers", "2"],
    "summary": ["summary", "a.nc"],
    "report": ["report", "a.nc", "--out", "a.html"],
    "view": ["view", MODEL, "--out", "view.html"],
}
LASTING = {"run --workers": 9.0, "allocate --workers": 9.0}  # s: the signal comes within that time; others 4.5 s


def trial(name: str, number: int, folder: Path, rng: random.Random) -> tuple[str, str]:
    """Return how a command ended after a signal at a random instant, and its last words."""
    instant, sent = rng.uniform(0, LASTING.get(name, 4.5)), rng.choice((signal.SIGINT, signal.SIGINT, signal.SIGTERM))
    to_group = rng.random() < 0.5
    with (folder / f"{number}.txt").open("w+b") as words:
        process = subprocess.Popen(
            [sys.executable, "-m", "tolcontact", *COMMANDS[name]], cwd=folder, stdout=subprocess.DEVNULL, stderr=words,
            stdin=subprocess.DEVNULL, start_new_session=True,
        )  # fmt: skip
        try:
            process.wait(instant)
        except subprocess.TimeoutExpired:
            (os.killpg if to_group else os.kill)(process.pid, sent)
        began = time.monotonic()
        try:
            code = process.wait(PATIENCE)
        except subprocess.TimeoutExpired:
            code = None
        seconds = time.monotonic() - began
        with contextlib.suppress(ProcessLookupError):
            os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        words.seek(0)
        text = words.read().decode(errors="replace")
    where = f"{name}, {sent.name}{' to the group' if to_group else ''} at {instant:.2f} s"
    return judged(code, sent, text, seconds), f"{where}: code {code} after {seconds:.1f} s: {text.strip()[-1500:]}"


def judged(code: int | None, sent: signal.Signals, text: str, seconds: float) -> str:
    if code is None:
        return "did not end"
    if "Traceback" in text or "Exception ignored" in text or "Error:" in text:
        return "traceback"
    if code == 128 + sent:
        return "stopped" if seconds < 10 else "stopped late"
    if code == -sent:
        return "ended before Python began"
    return "had ended" if code == 0 else "other code"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--tries", type=int, default=1000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", choices=COMMANDS)
    options = parser.parse_args()
    signal.signal(signal.SIGINT, signal.default_int_handler)  # a shell may have ignored it, and commands would inherit that
    rng = random.Random(options.seed)
    counts: dict[str, Counter[str]] = {name: Counter() for name in COMMANDS}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        subprocess.run(
            [sys.executable, "-m", "tolcontact", "run", MODEL, "--samples", "2000", "--out", "a.nc", "--quiet"],
            cwd=folder, check=True, stdout=subprocess.DEVNULL,
        )  # fmt: skip
        shutil.copy(folder / "a.nc", folder / "b.nc")
        for number in range(options.tries):
            command = options.only or rng.choice(list(COMMANDS))
            for left in folder.glob("run.nc*"):
                left.unlink()
            ending, words = trial(command, number, folder, rng)
            counts[command][ending] += 1
            if ending not in ("stopped", "had ended", "ended before Python began"):
                print(f"!! {ending}: {words}", flush=True)
    endings = sorted({ending for counter in counts.values() for ending in counter})
    print("| command | tries | " + " | ".join(endings) + " |")
    for command, counter in counts.items():
        if counter:
            print(f"| {command} | {counter.total()} | " + " | ".join(str(counter[ending]) for ending in endings) + " |")


if __name__ == "__main__":
    main()
