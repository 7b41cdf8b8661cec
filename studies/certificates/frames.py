"""Turn, mirror and scale assemblies, and compare their poses and statuses.

A turned assembly is shifted, too. A mirrored one stands beside the original, and both have the same deviations. All lengths of
a scaled one are multiplied by a factor: the raw poses show whether none was left out.

Contact points are spread over a face on a grid whose cells are a power of 2 of a mm. Factors other than powers of 2 choose
other points among equally distant ones, which changes answers of "active points" and of faces with form.
"""

import argparse
import json
import sys
import tempfile
import warnings
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

import tolcontact as tc
from tests.cases import frames
from tests.cases.frames import SHIFT, TURN
from tests.test_properties import AT_NIGHT, SCENES

FACTORS = 0.01, 1 / 128, 100.0
IMAGE = " image"
# Keys of a declaration whose numbers are lengths
LENGTHS = {
    "at", "args", "box", "inset", "inside", "limits", "loc", "lower", "nominal", "pin", "point", "position", "range", "scale",
    "spacing", "tolerance", "upper", "width", "within", "length", "sigma",
}  # fmt: skip
LIMIT = 1e-6  # of the size


class Original:
    """An assembly and its run, with the declaration and the meshes that its archive holds."""

    def __init__(self, assembly: tc.Assembly, method: tc.Method | None = None, samples: int = 24, seed: int = 5) -> None:
        self.method, self.samples, self.seed = method, samples, seed
        with tempfile.TemporaryDirectory() as folder:
            self._run(assembly, out=Path(folder) / "run.nc").close()
            with xr.open_datatree(Path(folder) / "run.nc") as tree:
                self.tree = tree.load()
        self.size = float(max(np.abs(self.tree[f"field/{name}"].vertices).max() for name in self.tree["field"].children))

    def _run(self, assembly: tc.Assembly, **options: Any) -> Any:
        program = tc.build(assembly, solver="daqp", method=self.method)
        return tc.run(program, samples=self.samples, seed=self.seed, surfaces=0, **options)

    def changed(self, change: Callable[[Any], Any], factor: float = 1.0) -> Any:
        """Return the run of the model after a change of its declaration, with meshes multiplied by a factor."""
        tree = self.tree.copy(deep=True)
        tree["model"]["declaration"] = xr.DataArray(json.dumps(change(json.loads(str(tree["model"]["declaration"].values)))))
        if "mesh" in tree["model"].children:
            for group in tree["model/mesh"].children.values():
                group["vertices"] = group["vertices"] * factor
        return self._run(tc.io.model_of(tree), fields="none")

    def turned(self) -> tuple[float, bool]:
        """Return how far poses of the turned assembly differ [sizes], and whether its statuses are equal."""

        def change(document: Any) -> Any:
            frames.turn(document)
            return document

        run, T = self.changed(change), TURN.as_matrix()
        R = T.T @ run.rotation.values @ T
        t = (run.translation.values + run.rotation.values @ SHIFT - SHIFT) @ T
        return self.compared(R, t, run.status.values)

    def scaled(self, factor: float) -> tuple[float, bool]:
        """Return how far poses of the scaled assembly differ [sizes], and whether its statuses are equal."""
        run = self.changed(lambda document: scaled(document, factor), factor)
        return self.compared(run.rotation.values, run.translation.values / factor, run.status.values)

    def mirrored(self) -> tuple[float, bool]:
        """Return how far poses of an image and its original differ [sizes], and whether all are certified as alone."""
        model = tc.io.model_of(self.tree)
        at = -10 * self.size
        model.mirrored(*model.parts, plane="x", at=at, names=("\0", IMAGE.strip()))
        sample = self.tree["sample"]
        values = dict(zip(sample.contributor.values.tolist(), sample.deviation.values.T, strict=True))
        program = tc.build(model, solver="daqp", method=self.method)
        columns = {
            label: values[label.replace(IMAGE, "")]
            for label in program.nominal.contributors
            if label.replace(IMAGE, "") in values
        }
        model.population(columns)
        run = self._run(model, fields="none")
        names, M = run.part.values.tolist(), np.diag([-1.0, 1.0, 1.0])
        own, images = ([names.index(name + end) for name in self.tree.part.values.tolist()] for end in ("", IMAGE))
        rotation, translation = run.rotation.values, run.translation.values
        shift = np.array([2 * at, 0, 0])
        t = (translation[:, :, images] + rotation[:, :, images] @ shift - shift) @ M
        far = (
            np.abs(t - translation[:, :, own]).max() / self.size,
            np.abs(M @ rotation[:, :, images] @ M - rotation[:, :, own]).max(),
        )
        return float(max(far)), bool((run.status <= tc.Status.RESOLVED).all() == (self.tree.status <= tc.Status.RESOLVED).all())

    def compared(self, R: np.ndarray, t: np.ndarray, status: np.ndarray) -> tuple[float, bool]:
        rotation, translation = self.tree.rotation.values, self.tree.translation.values
        raw = np.abs(t - translation)[:, 0].max() / self.size
        if raw > LIMIT:
            raise ValueError(f"raw poses differ by {raw:.1e}: this model has lengths that the change leaves out")
        far = np.abs(t - translation).max() / self.size, np.abs(R - rotation).max()
        return float(max(far)), bool(np.array_equal(status, self.tree.status.values))


def scaled(entry: Any, factor: float, is_length: bool = False) -> Any:
    """Return an entry of a declaration with its lengths multiplied by a factor."""
    if isinstance(entry, dict):
        return {key: scaled(value, factor, key in LENGTHS or (is_length and key != "points")) for key, value in entry.items()}
    if isinstance(entry, list):
        return [scaled(value, factor, is_length) for value in entry]
    is_number = isinstance(entry, int | float) and not isinstance(entry, bool)
    return entry * factor if is_length and is_number else entry


def comparisons(original: Original) -> Iterator[tuple[str, tuple[float, bool]]]:
    """Yield the changes of an assembly, and what they change."""
    yield "turned", original.turned()
    for factor in FACTORS:
        yield f"times {factor:.2g}", original.scaled(factor)
    if not tc.io.model_of(original.tree).variables:  # they drive the locators of originals alone
        yield "mirrored", original.mirrored()


def main() -> int:
    """Compare scenes of the property table and models; return 1 if statuses or poses differ."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("names", nargs="*", help="scenes of tests/test_properties.py, and models; all by default")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    models = {path.stem: (lambda path=path: frames.model(path.stem), None) for path in sorted(frames.MODELS.glob("*.py"))}
    cases: dict[str, Any] = SCENES | AT_NIGHT | models
    differing = 0
    for name in options.names or cases:
        try:
            declare, solver = cases[name]
            original = Original(declare(), solver)
            for change, (difference, is_equal) in comparisons(original):
                is_same = is_equal and difference < LIMIT
                differing += not is_same
                print(f"{name:24} {change:12} {difference:.1e} {'' if is_equal else 'other statuses'}", flush=True)
        except Exception as error:
            print(f"{name:24} {type(error).__name__}: {str(error).splitlines()[-1][:120]}", flush=True)
    return int(differing > 0)


if __name__ == "__main__":
    sys.exit(main())
