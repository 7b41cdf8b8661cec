"""Pictures of assemblies and displacement fields by pyvista, which also draws without a display."""

from typing import Any, Literal

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.declaration import Assembly
from tolcontact.discretization import discretize
from tolcontact.errors import OptionError, check_choice
from tolcontact.report.annotations import Mark, Marks, marks_of, marks_of_nominal

try:
    import pyvista as pv
except ModuleNotFoundError as error:
    raise OptionError("bodies need pyvista, which is not installed; install it: pip install '.[plot]'") from error

STATISTICS = {"mean": terms.FIELD_MEAN, "6 sigma": terms.FIELD_SIX_SIGMA}
GREYS = ("#9fb3c8", "#c8b79f", "#a8c89f", "#c89fb8", "#b3a8d0", "#9fc8c0")
INK, LOCATOR, FORCE, CONTACT, MEASURE = "#30363d", "#1f5fa8", "#7a3fb0", "#0a7d4f", "#d01c1c"
SEQUENTIAL, DIVERGING = "viridis", "RdBu_r"
AMBIENT = 0.45  # share of light without a direction, so that faces in shadow keep their colour
MIN_EDGE_ANGLE = 25.0  # degrees: sharper edges are drawn
VIEWPOINT = (-1.0, -2.4, 1.5)  # the direction from the assembly to the viewer


_Body = tuple[np.ndarray, np.ndarray]  # vertices in the nominal pose [mm], and triangles


def assembly(
    source: xr.DataTree | Assembly,
    *,
    realization: int | None = None,
    state: terms.StateName = "corrected",
    marks: bool = True,
    opacity: float = 1.0,
    plotter: Any = None,
) -> Any:
    """Draw the bodies of results or of a declared model, with locators, contact points, measures and forces.

    `tc.plot.assembly(results, realization=7, opacity=0.6).show()` draws the `source` with that opacity, 1 by default, into a
    new `plotter` or a given one. The bodies are drawn in their nominal poses, or in their poses in a `realization` of results
    and its `state`; marks are always drawn in their nominal positions, unless `marks=False`. Returns a pyvista.Plotter. Raises
    OptionError for a realization or a state that does not exist, and ModelError for a model with faults.
    """
    is_new = plotter is None
    plotter = _new_plotter() if is_new else plotter
    bodies, annotations = _declared(source) if isinstance(source, Assembly) else (_bodies(source), marks_of(source))
    for number, (vertices, faces) in enumerate(bodies):
        mesh = pv.make_tri_mesh(vertices, faces)
        if realization is not None:
            mesh.points = _moved(source, number, realization, state, vertices)
        plotter.add_mesh(mesh, color=GREYS[number % len(GREYS)], opacity=opacity, ambient=AMBIENT, diffuse=1 - AMBIENT)
        _add_edges(plotter, mesh)
    if marks:
        extent = np.ptp(np.concatenate([vertices for vertices, _ in bodies]), axis=0)
        _add_marks(plotter, annotations, float(np.linalg.norm(extent)))
    return _in_view(plotter) if is_new else plotter


def field(
    results: xr.DataTree,
    statistic: Literal["mean", "6 sigma"] = "6 sigma",
    *,
    component: terms.ComponentName = "magnitude",
    state: terms.StateName = "corrected",
    limits: tuple[float, float] | None = None,
    plotter: Any = None,
) -> Any:
    """Draw the displacement field of all parts as colours [mm].

    `tc.plot.field(results, "mean", component="z").show()` draws the `statistic` "mean" of a `component` of the displacements
    in a `state`, into a new `plotter` or a given one; by default 6 sigma of the corrected magnitudes. Colours cover `limits`,
    or by default the values of both states of all parts, so that pictures of both states can be compared. Returns a
    pyvista.Plotter. Raises OptionError for an unknown statistic, component or state, and for an archive without fields.
    """
    check_choice("statistic", statistic, tuple(STATISTICS))
    check_choice("component", component, terms.COMPONENTS)
    check_choice("state", state, terms.STATES)
    name, selection = STATISTICS[statistic].name, {terms.COMPONENT: component}
    fields = [group[name].sel(selection) for group in _groups(results)]
    values = np.concatenate([array.values.ravel() for array in fields])
    if not np.isfinite(values).any():
        raise OptionError("the archive has no displacement fields of this kind; run again with --fields")
    is_signed = statistic == "mean" and component != "magnitude"
    largest = np.nanmax(np.abs(values))
    low, high = limits or ((-largest, largest) if is_signed else (np.nanmin(values), largest))
    is_new = plotter is None
    plotter = _new_plotter() if is_new else plotter
    title = f"{statistic} of displacement, {component} [mm]\n"
    for body, array in zip(_bodies(results), fields, strict=True):
        mesh = pv.make_tri_mesh(*body)
        mesh["field"] = array.sel({terms.STATE: state}).values
        plotter.add_mesh(
            mesh, scalars="field", clim=(float(low), float(high)), cmap=DIVERGING if is_signed else SEQUENTIAL, lighting=False,
            scalar_bar_args={"title": title, "color": "black", "n_labels": 5, "fmt": "%.3g"},
        )  # fmt: skip
        _add_edges(plotter, mesh)
    return _in_view(plotter) if is_new else plotter


def _new_plotter() -> Any:
    pv.vtk_verbosity("off")  # VTK would print a line where there is no display
    plotter = pv.Plotter(off_screen=True, window_size=(1200, 900), line_smoothing=True)
    plotter.set_background("white")
    return plotter


def _in_view(plotter: Any) -> Any:
    plotter.enable_parallel_projection()
    plotter.view_vector(VIEWPOINT, viewup=(0, 0, 1))
    return plotter


def _groups(results: xr.DataTree) -> list[xr.Dataset]:
    names = results.to_dataset()[terms.PART].values
    return [results[terms.field_of(str(name))].to_dataset() for name in names]


def _bodies(results: xr.DataTree) -> list[_Body]:
    return [(group[terms.FIELD_VERTICES.name].values, group[terms.FIELD_FACES.name].values) for group in _groups(results)]


def _declared(model: Assembly) -> tuple[list[_Body], Marks]:
    nominal = discretize(model)
    return [(part.vertices, part.faces) for part in nominal.last_parts], marks_of_nominal(nominal)


def _moved(results: xr.DataTree | Assembly, part: int, realization: int, state: str, vertices: np.ndarray) -> np.ndarray:
    check_choice("state", state, terms.STATES)
    if isinstance(results, Assembly):
        raise OptionError("a declared model has no realizations; give results instead, or leave out `realization`")
    rows = results.to_dataset()
    if not 0 <= realization < rows.sizes[terms.REALIZATION]:
        raise OptionError(f"realization is {realization}; expected 0 to {rows.sizes[terms.REALIZATION] - 1}")
    if terms.ROTATION.name not in rows:
        raise OptionError("the archive has no poses; run again with --keep poses")
    at = {terms.REALIZATION: realization, terms.STATE: terms.STATES.index(state), terms.PART: part}
    R, t = (rows[variable.name].isel(at).values for variable in (terms.ROTATION, terms.TRANSLATION))
    return vertices @ R.T + t


def _add_edges(plotter: Any, mesh: Any) -> None:
    edges = mesh.extract_feature_edges(MIN_EDGE_ANGLE, boundary_edges=False, non_manifold_edges=False, manifold_edges=False)
    if edges.n_points:
        plotter.add_mesh(edges, color=INK, line_width=1.5)


def _add_marks(plotter: Any, marks: Marks, size: float) -> None:
    def arrow(mark: Mark, length: float, colour: str) -> None:
        """Add an arrow that points at the position of the mark."""
        along = np.array(mark["along"]) / np.linalg.norm(mark["along"])
        start = np.array(mark["at"]) - length * along
        plotter.add_mesh(pv.Arrow(start=start, direction=along, scale=length, tip_radius=0.2, shaft_radius=0.08), color=colour)

    for locator in marks.locators:
        arrow(locator, 0.07 * size, LOCATOR)
    for force in marks.forces:
        if force["at"] is not None:
            arrow(force, 0.1 * size, FORCE)
    for pair in marks.contacts:
        if len(pair["points"]):
            plotter.add_points(np.array(pair["points"]), color=CONTACT, point_size=5, render_points_as_spheres=True)
    for measure in marks.measures:
        plotter.add_points(np.array(measure["points"]), color=MEASURE, point_size=12, render_points_as_spheres=True)
        for line in measure["lines"]:
            plotter.add_mesh(pv.Line(*line), color=MEASURE, line_width=2)
