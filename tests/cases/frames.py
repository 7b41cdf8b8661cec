"""Where a whole assembly stands, and the scripts of `models/`."""

import runpy
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

import tolcontact as tc

MODELS = Path(__file__).resolve().parents[2] / "models"
TURN, SHIFT = Rotation.from_rotvec((0.4, -1.1, 0.7)), np.array((310.0, -170.0, 90.0))  # mm


def model(name: str, *choices) -> tc.Assembly:
    """The assembly of a script in `models/`."""
    return runpy.run_path(str(MODELS / f"{name}.py"))["assembly"](*choices)


class Frame:
    """A rigid motion, and a stretch, of a whole assembly: what its results must not depend on."""

    def __init__(self, turn=(0.0, 0.0, 0.0), shift=(0.0, 0.0, 0.0), scale=1.0):
        self.R, self.shift, self.scale = Rotation.from_rotvec(turn), np.array(shift), scale

    def place(self, *at):
        return {"at": self.R.apply(np.array(at) * self.scale) + self.shift, "rotation": self.R.as_rotvec()}

    def box(self, *size):
        return tc.Box(*(self.scale * s for s in size))

    def along(self, *direction):
        return tuple(self.R.apply(direction))


STILL = Frame()


def turn(document: dict[str, Any]) -> None:
    """Turn and shift all parts of a declaration, and the directions of its measures and forces."""
    for part in document["parts"]:
        part["at"] = (TURN.apply(part["at"]) + SHIFT).tolist()
        part["rotation"] = (TURN * Rotation.from_rotvec(part["rotation"])).as_rotvec().tolist()
    angles = [measure["of"] for measure in document["measures"] if "about" in measure.get("of", ())]
    for entries, name in ((document["measures"], "along"), (document["forces"], "vector"), (angles, "about")):
        for entry in entries:
            if entry.get(name) is not None:
                entry[name] = TURN.apply(entry[name]).tolist()
