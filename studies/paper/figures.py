"""Counterparts of the paper's figures 3 to 7, drawn from an archive alone. Works without a display."""

import json
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pyvista as pv
import trimesh
import xarray as xr
from PIL import Image
from scipy.spatial import Delaunay

import tolcontact as tc
from studies.paper.published import PAPER, STATES

mpl.use("Agg")
pv.vtk_verbosity("off")  # without a display VTK says so, and goes on
GREY, DARK, BLUE, RED, GREEN = "#c9ced6", "#8f98a5", "#2f6fb7", "#d03b30", "#1f8a5b"
VIEWS = {"RA1": (-1.0, -2.4, 1.5), "RA2": (-1.5, -1.7, 1.5)}
FINE = 2  # how many times finer a picture is drawn than saved
TITLES = {"raw": "contactless", "corrected": "contact"}


def surface(run: xr.DataTree, part: str) -> pv.PolyData:
    """Return the surface of a part in its nominal place [mm]."""
    field = run[f"field/{part}"]
    return pv.make_tri_mesh(field.vertices.values, field.faces.values)


def moved(run: xr.DataTree, part: str, realization: int, state: str) -> pv.PolyData:
    """Return the surface of a part in one realization."""
    at = {"realization": realization, "state": state, "part": part}
    mesh = surface(run, part)
    mesh.points = mesh.points @ run.rotation.sel(at).values.T + run.translation.sel(at).values
    return mesh


def area(run: xr.DataTree, pair: int) -> pv.PolyData:
    """Return the contact area of a pair as triangles between its points."""
    contact = run["contact"]
    points = contact.moving_point.values[contact.pair_of_point.values == pair]
    _, _, axes = np.linalg.svd(points - points.mean(axis=0), full_matrices=False)
    corners = Delaunay((points - points.mean(axis=0)) @ axes[:2].T).simplices
    longest = np.linalg.norm(points[corners] - points[np.roll(corners, 1, axis=1)], axis=2).max(axis=1)
    return pv.make_tri_mesh(points, corners[longest < 2 * np.median(longest)])  # holes stay holes


def measured(run: xr.DataTree) -> tuple[np.ndarray, np.ndarray]:
    """Where the first measure is taken [mm], and along which direction."""
    model = json.loads(run["model"].declaration.item())
    measure = model["measures"][0]
    (part,) = (part for part in model["parts"] if part["name"] == measure["of"]["part"])
    return np.add(measure["of"]["position"], part["at"]), np.array(measure["along"])


def stage(columns: int, height: int, *, bar: bool = False) -> pv.Plotter:
    """Return an empty picture with this number of columns, and with space for a colour bar below them if `bar`."""
    rows = {"shape": (2, columns), "row_weights": [1, 0.2], "groups": [(1, slice(None))]} if bar else {"shape": (1, columns)}
    size = (FINE * 800 * columns, FINE * height)
    plotter = pv.Plotter(off_screen=True, window_size=size, border=False, line_smoothing=True, **rows)
    plotter.set_background("white")
    return plotter


def outline(plotter: pv.Plotter, body: pv.PolyData) -> None:
    edges = body.extract_feature_edges(20, boundary_edges=False, non_manifold_edges=False, manifold_edges=False)
    plotter.add_mesh(edges, color="#303640", line_width=1.5 * FINE)


def glass(plotter: pv.Plotter, body: pv.PolyData, colour: str) -> None:
    """Draw only the faces towards the viewer: without a display, translucent faces are not sorted by depth."""
    plotter.add_mesh(body, color=colour, opacity=0.35, culling="back")


def caption(plotter: pv.Plotter, text: str) -> None:
    plotter.add_text(text, font_size=10 * FINE, color="black", position="upper_left")


def look(plotter: pv.Plotter, name: str) -> None:
    plotter.enable_parallel_projection()
    plotter.view_vector(VIEWS[name], viewup=(0, 0, 1))
    plotter.camera.zoom(1.35)


def save(plotter: pv.Plotter, path: Path) -> None:
    """Drawn larger and scaled down, which smooths edges; as a palette picture, it takes a third of the size."""
    picture = Image.fromarray(plotter.screenshot(None, return_img=True))
    picture = picture.resize((picture.width // FINE, picture.height // FINE), Image.Resampling.LANCZOS)
    picture.quantize(256, dither=Image.Dither.NONE).save(path, optimize=True)
    plotter.close()
    print(f"{path.name}: {path.stat().st_size // 1024} kB")


def figure_3(runs: dict[str, xr.DataTree], path: Path) -> None:
    """Draw the assemblies with locators, contact area and measure."""
    plotter = stage(2, 500)
    for column, (name, run) in enumerate(runs.items()):
        plotter.subplot(0, column)
        for part in run.part.values:
            body = surface(run, part)
            solid = part == PAPER[name].part
            glass(plotter, body, GREY if solid else DARK)
            outline(plotter, body)
        for pair in range(run.sizes["pair"]):
            grid = area(run, pair)
            grid.points += 0.3 * np.array(VIEWS[name])  # before the faces in which it lies
            plotter.add_mesh(grid, color=BLUE, opacity=0.4, lighting=False)
            plotter.add_mesh(grid, color=BLUE, style="wireframe", line_width=FINE / 2)
        sample = run["sample"]
        for point, direction in zip(sample.locator_point.values, sample.locator_direction.values, strict=True):
            plotter.add_mesh(
                pv.Arrow(start=point - 14 * direction, direction=direction, scale=14, shaft_radius=0.09, tip_radius=0.22),
                color=RED,
            )
        point, along = measured(run)
        plotter.add_mesh(pv.Arrow(start=point, direction=along, scale=18, shaft_radius=0.07, tip_radius=0.17), color=GREEN)
        plotter.add_mesh(pv.Sphere(radius=1.6, center=point), color=GREEN)
        caption(plotter, name)
        look(plotter, name)
    save(plotter, path)


def figure_4(run: xr.DataTree, path: Path) -> None:
    """Draw the contact points of RA1."""
    plotter = stage(1, 420)
    plotter.add_mesh(surface(run, "base"), color=GREY)
    points = run["contact"].moving_point.values
    plotter.add_mesh(
        pv.PolyData(points + np.array([0, 0, 0.3])), color=BLUE, point_size=11 * FINE, render_points_as_spheres=True
    )
    caption(plotter, f"{len(points)} contact points")
    look(plotter, "RA1")
    save(plotter, path)


def figure_5(run: xr.DataTree, realization: int, path: Path) -> None:
    """One realization of RA1, raw and corrected, with what lies in both blocks."""
    plotter = stage(2, 460)
    for column, state in enumerate(STATES):
        plotter.subplot(0, column)
        base, top = (moved(run, part, realization, state) for part in ("base", "top"))
        solids = [trimesh.Trimesh(body.points, body.regular_faces) for body in (base, top)]
        common = trimesh.boolean.intersection(solids, engine="manifold")
        if common.volume > 1:  # mm3; touching faces of a boolean in single precision leave less
            plotter.add_mesh(pv.make_tri_mesh(common.vertices, common.faces), color=RED, lighting=False)
        for body, colour in ((base, DARK), (top, BLUE)):
            glass(plotter, body, colour)
            outline(plotter, body)
        depth = max(-float(run.gap_min.sel(realization=realization, state=state).min()), 0)
        caption(plotter, f"{TITLES[state]}: {depth:.2f} mm deep")
        look(plotter, "RA1")
    save(plotter, path)


def figure_6_7(name: str, run: xr.DataTree, path: Path) -> None:
    """6 sigma of the displacement magnitude in both states, on the paper's colour scale."""
    plotter = stage(2, 600, bar=True)
    for column, state in enumerate(STATES):
        plotter.subplot(0, column)
        tc.plot.field(run, state=state, limits=PAPER[name].scale, plotter=plotter)
        plotter.remove_scalar_bar()
        fields = [run[f"field/{part}"].six_sigma.sel(state=state, component="magnitude") for part in run.part.values]
        top = float(max(field.max() for field in fields))
        caption(plotter, f"{TITLES[state]}: up to {top:.1f} mm")
        look(plotter, name)
    plotter.subplot(1, 0)
    mesh = surface(run, run.part.values[0])
    mesh["field"] = fields[0].values
    plotter.add_mesh(mesh, opacity=0.0, cmap="viridis", clim=PAPER[name].scale, show_scalar_bar=False)
    plotter.add_scalar_bar(
        "6 sigma of the displacement magnitude [mm]\n", n_labels=5, fmt="%.1f", color="black",
        position_x=0.3, position_y=0.1, width=0.4, height=0.7, title_font_size=18 * FINE, label_font_size=16 * FINE,
    )  # fmt: skip
    save(plotter, path)


def deep(run: xr.DataTree) -> int:
    """Return a realization of RA1 whose blocks overlap by 5 mm, the range on each side: a clear and common case."""
    depth = -run.gap_min.sel(state="raw").min("pair").values
    return int(np.abs(depth - 5).argmin())


def draw(runs: dict[str, xr.DataTree], folder: Path) -> None:
    """All figures of the paper into `folder`, from `runs`."""
    figure_3(runs, folder / "figure3.png")
    figure_4(runs["RA1"], folder / "figure4.png")
    figure_5(runs["RA1"], deep(runs["RA1"]), folder / "figure5.png")
    figure_6_7("RA1", runs["RA1"], folder / "figure6.png")
    figure_6_7("RA2", runs["RA2"], folder / "figure7.png")
