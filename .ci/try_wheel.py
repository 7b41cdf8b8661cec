"""Try the installed package: commands on a model without extras, and the message of each extra that is missing.

python .ci/try_wheel.py     in an environment where the wheel is installed, outside the clone or in it
"""

import importlib.util
import os
import subprocess
import sys
import tempfile
from pathlib import Path

MODELS = Path(__file__).resolve().parents[1] / "models"
FEW = ("--samples", "200", "--seed", "1")
BOX = """import tolcontact as tc


def assembly():
    model = tc.Assembly("boxes")
    base = model.part("base", tc.Box(60, 60, 10), fixed=True)
    lid = model.part("lid", tc.Box(60, 60, 5), at=(0, 0, 10))
    model.locate(lid, tc.three_two_one(lid.face("-z"), lid.face("-y"), lid.face("-x"), inset=5), tolerance=0.5)
    model.contact("joint", moving=lid.face("-z"), reference=base.face("+z"))
    model.measure("height", lid.point(60, 60, 5), along="z", tolerance=1)
    return model
"""
COMMANDS = (
    ("--version",), ("run", MODELS / "ra1.py", *FEW, "--out", "ra1.nc"), ("summary", "ra1.nc"), ("report", "ra1.nc"),
    ("run", MODELS / "ra1.py", "--samples", "300", "--out", "ra1.nc", "--resume"), ("contributions", "ra1.nc"),
    ("sensitivities", "ra1.nc"), ("check", "größe 1/kiste.py"), ("run", "größe 1/kiste.py", *FEW, "--out", "größe 1/kiste.nc"),
    ("run", MODELS / "ra1.py", "--samples", "200", "--seed", "2", "--out", "other.nc"), ("compare", "ra1.nc", "other.nc"),
)  # fmt: skip
EXTRAS = (  # a module, what needs it, the extra that brings it
    ("OCP", ("bodies", "empty.step"), "step"),
    ("openpyxl", ("report", "ra1.nc", "--xlsx", "x.xlsx"), "xlsx"),
    ("distributed", ("run", MODELS / "ra1.py", *FEW, "--workers", "1"), "dask"),
)


def call(folder: Path, *command: object) -> subprocess.CompletedProcess[str]:
    """Run a command of tolcontact in a folder."""
    environment = {**os.environ, "PYTHONIOENCODING": "utf-8"}
    return subprocess.run(
        [sys.executable, "-P", "-m", "tolcontact", *map(str, command)],
        cwd=folder, env=environment, capture_output=True, encoding="utf-8", stdin=subprocess.DEVNULL, check=False,
    )  # fmt: skip


def main() -> None:
    """Run all commands in a folder for temporary files; exit with code 1 at the first one that does not do its work."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "größe 1").mkdir()
        (folder / "größe 1" / "kiste.py").write_text(BOX, encoding="utf-8-sig", newline="\r\n")
        (folder / "empty.step").write_text("ISO-10303-21;\nHEADER;\nENDSEC;\nDATA;\nENDSEC;\nEND-ISO-10303-21;\n")
        for command in COMMANDS:
            done = call(folder, *command)
            if done.returncode:
                sys.exit(f"{command}: exit code {done.returncode}\n{done.stdout}{done.stderr}")
            print("done:", *command[:2], flush=True)
        for module, command, extra in EXTRAS:
            if importlib.util.find_spec(module) is None:
                done = call(folder, *command)
                if done.returncode != 2 or f"[{extra}]" not in done.stderr or "Traceback" in done.stderr:
                    sys.exit(f"{command}: expected a message that asks for [{extra}], got\n{done.stdout}{done.stderr}")
    print(f"{len(COMMANDS)} commands work on Python {sys.version.split()[0]}, {sys.platform}")


if __name__ == "__main__":
    main()
