"""Surfaces as they were read, beside the numbers in the text of their STEP files: python -m studies.cad.compare_numbers FILES.

The text is read here by itself, entity by entity; a file whose shapes have lengths in several units is left out.
"""

import re
import sys
from pathlib import Path

import numpy as np

import tolcontact as tc
from tolcontact.errors import GeometryFault
from tolcontact.geometry.files import read_files
from tolcontact.geometry.files.product import Product

FAR = 1e3  # [mm] at which turned normals are compared
SIZES = {"INCH": 25.4, "MILLI": 1.0, "$,.METRE.": 1e3}  # [mm] of units, by what their entities have in them


def numbers_of(path: Path) -> tuple[np.ndarray, np.ndarray, float]:
    """Planes (plane, 4) as normal and offset, radii (cylinder,), and the size of the unit of both [mm], 0 if it is not one."""
    text = re.sub(r"/\*.*?\*/", "", path.read_text(errors="replace"), flags=re.DOTALL)
    entities = dict(re.findall(r"#(\d+)\s*=\s*((?:'[^']*'|[^';])*);", text))
    entities = {key: re.sub(r"\s+", "", value) for key, value in entities.items()}
    bare = {key: re.sub("'[^']*'", "''", value) for key, value in entities.items()}  # names may look like references

    def listed(key: str) -> np.ndarray:
        return np.array(re.findall(r"\(([-+.\dEe,]+)\)", bare[key])[-1].split(","), dtype=float)

    planes, radii, units = [], [], set()
    for entity in bare.values():
        if plane := re.match(r"PLANE\('',#(\d+)\)", entity):
            point, normal = re.findall(r"#(\d+)", bare[plane[1]])[:2]
            own = listed(normal) / np.linalg.norm(listed(normal))
            planes.append([*own, listed(point) @ own])
        if cylinder := re.match(r"CYLINDRICAL_SURFACE\('',#\d+,([^)]*)\)", entity):
            radii.append(float(cylinder[1]))
        if "GLOBAL_UNIT_ASSIGNED_CONTEXT" in entity:
            assigned = re.findall(r"#(\d+)", entity[entity.index("GLOBAL_UNIT_ASSIGNED_CONTEXT") :])
            units |= {entities[key] for key in assigned if "LENGTH_UNIT" in entities.get(key, "")}
    sizes = {next((size for word, size in SIZES.items() if word in unit.upper()), 0.0) for unit in units}
    return np.array(planes).reshape(-1, 4), np.array(radii), sizes.pop() if len(sizes) == 1 else 0.0


def main() -> None:
    """Print the largest differences over all files, and the files that have them."""
    files, planes, cylinders, worst = 0, 0, 0, [(0.0, ""), (0.0, "")]
    for name in sys.argv[1:]:
        (content,) = read_files([tc.Mesh(name)]).values()
        stated, radii, size = numbers_of(Path(name))
        if not isinstance(content, Product) or not size:
            print(f"{name}: left out ({'not read' if isinstance(content, GeometryFault) else 'several units'})")
            continue
        files += 1
        stated[:, 3:], radii = stated[:, 3:] * size, radii * size
        for surface in (face.surface for shape in content.shapes for face in shape.faces if face.surface is not None):
            if surface.kind == "plane":
                own = np.array([*surface.axis, surface.axis @ surface.origin])
                off = min(np.abs((stated - sign * own) * [FAR, FAR, FAR, 1]).max(axis=1).min() for sign in (1, -1))
                planes, worst[0] = planes + 1, max(worst[0], (off, name))
            elif surface.kind == "cylinder" and radii.size:  # of splines no radius is stated
                cylinders, worst[1] = cylinders + 1, max(worst[1], (np.abs(radii - surface.radius).min(), name))
    print(f"{files} files")
    print(f"{planes} planes: within {worst[0][0]:.2g} mm (normals at {FAR:g} mm) of the text; {worst[0][1]}")
    print(f"{cylinders} cylinders: radii within {worst[1][0]:.2g} mm; {worst[1][1]}")


if __name__ == "__main__":
    main()
