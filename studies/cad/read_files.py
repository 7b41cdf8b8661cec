"""Read STEP files of other people, and say of each what came out: python -m studies.cad.read_files FOLDER.

Prints a table in Markdown. Each file is read in a process of its own, whose time and memory (of its reader process) are told.
"""

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import numpy as np

import tolcontact as tc
from tolcontact.errors import GeometryFault
from tolcontact.geometry.files import read_files
from tolcontact.geometry.files.product import Product

PATIENCE = 600.0  # s


def off(product: Product) -> dict[str, float]:
    """How far vertices lie off the surfaces that the file states, by their kind [mm]."""
    worst: dict[str, float] = {}
    for shape in product.shapes:
        for number, surface in enumerate(face.surface for face in shape.faces):
            vertices = shape.vertices[np.unique(shape.triangles[shape.brep == number])]
            if surface is not None and len(vertices):
                worst[surface.kind] = max(worst.get(surface.kind, 0.0), float(np.abs(surface.distance(vertices)[0]).max()))
    return worst


def read(path: Path) -> dict:
    """Read a file, and return the outcome as a row."""
    start = time.perf_counter()
    (content,) = read_files([tc.Mesh(path)]).values()
    record = {"seconds": time.perf_counter() - start, "MB": resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1e3}
    if isinstance(content, GeometryFault):
        return record | {"message": str(content).replace(str(path), path.name)}
    assert isinstance(content, Product)
    return record | {
        "bodies": len(content.bodies),
        "faces": sum(len(np.unique(body.shape.brep)) for body in content.bodies),
        "analytic": sum(face.surface is not None for shape in content.shapes for face in shape.faces),
        "of": content.face_count,
        "triangles": sum(len(shape.triangles) for shape in content.shapes),
        "off": off(content),
    }


def main() -> None:
    if sys.argv[1] == "--one":
        print(json.dumps(read(Path(sys.argv[2]))))
        return
    print("| file | bodies | faces | of shapes, analytic | triangles | s | MB | vertices off [mm] |")
    print("|---|---:|---:|---:|---:|---:|---:|---|")
    for path in sorted(Path(sys.argv[1]).glob("*.st*p")):
        command = [sys.executable, "-m", "studies.cad.read_files", "--one", str(path)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE, check=False)
        if done.returncode:
            print(f"| {path.name} | the process ended with {done.returncode}: {done.stderr.strip()[-200:]} |", flush=True)
            continue
        found = json.loads(done.stdout.strip().splitlines()[-1])
        end = f"{found['seconds']:.1f} | {found['MB']:.0f} |"
        if "message" in found:
            print(f"| {path.name} | {found['message'][:160]} | | | | {end} |", flush=True)
            continue
        offs = ", ".join(f"{kind} {most:.0e}" for kind, most in found["off"].items())
        counts = f"{found['bodies']} | {found['faces']} | {found['analytic']} of {found['of']} | {found['triangles']}"
        print(f"| {path.name} | {counts} | {end} {offs} |", flush=True)


if __name__ == "__main__":
    main()
