"""The scenes of stations: the parts and marks of a station, and the poses of its parts in single realizations."""

from typing import Any

import numpy as np
import xarray as xr

from tolcontact import vocabulary as terms
from tolcontact.discretization import Nominal
from tolcontact.report.html.form_scene import SingleStates

Scene = dict[str, Any]


def stations_of(results: xr.DataTree) -> list[Scene]:
    """Return the scene of each station of an archive; none without stations."""
    if terms.STATIONS_GROUP not in results.children:
        return []
    rows, groups = results.to_dataset(), results[terms.STATIONS_GROUP].children.values()
    names = [str(group.attrs["station"]) for group in groups]
    order = {str(part): number for number, part in enumerate(rows[terms.PART].values)}
    locators = [str(name) for name in results["sample"].to_dataset()[terms.LOCATOR].values]  # station.body.locator
    owners = [max((name for name in names if locator.startswith(f"{name}.")), key=len, default="") for locator in locators]
    return [
        {
            "name": name,
            "parts": [order[str(part)] for part in group.to_dataset()[terms.STATION_PART].values],
            "locators": [locator for locator, station in zip(locators, owners, strict=True) if station == name],
            "contacts": _labels(rows, terms.PAIR, terms.PAIR_STATION, name),
            "measures": _labels(rows, terms.MEASURE, terms.MEASURE_STATION, name),
        }
        for name, group in zip(names, groups, strict=True)
    ]


def stations_of_nominal(nominal: Nominal | None) -> list[Scene]:
    """Return the scene of each station of a model before a run; none for a model with faults, or without stations."""
    if nominal is None:
        return []
    return [
        {
            "name": scene.station,
            "parts": [nominal.assembly.parts.index(part) for part in scene.assembly.parts],
            "locators": [label for part in nominal.parts if part.station == scene.station for label in part.locators.labels],
            "contacts": [pair.name for pair in nominal.pairs if nominal.parts[pair.moving].station == scene.station],
            "measures": [measure.name for measure in scene.measures],
        }
        for scene in nominal.scenes
    ]


def station_poses(results: xr.DataTree, station: str, states: SingleStates) -> tuple[np.ndarray, np.ndarray] | None:
    """Return R (row, state, part, 3, 3) and t (row, state, part, 3) [mm] of all parts in a station; None if not archived.

    Parts that the station does not hold are in their nominal pose.
    """
    group = results[terms.station_group(station)].to_dataset()
    if terms.STATION_ROTATION.name not in group:
        return None
    t_held, R_held = (states.read(group, variable) for variable in terms.STATION_POSES)
    return _of_all_parts(results, station, R_held, t_held)


def worst_poses(results: xr.DataTree, station: str, worst: xr.Dataset | None) -> tuple[np.ndarray, np.ndarray]:
    """Return R (case, state, part, 3, 3) and t (case, state, part, 3) [mm] of worst cases in a station; none without them."""
    if worst is None:
        none = np.zeros((0, len(terms.STATES), results.sizes[terms.PART], 3, 3))
        return none, none[..., 0]
    groups = results[terms.STATIONS_GROUP].children.values()
    owners = np.repeat([group.attrs["station"] for group in groups], [group.sizes[terms.STATION_PART] for group in groups])
    t_held, R_held = (worst[variable.name].values[:, :, owners == station] for variable in terms.STATION_POSES)
    return _of_all_parts(results, station, R_held, t_held)


def _of_all_parts(results: xr.DataTree, station: str, R_held: np.ndarray, t_held: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return R and t of all parts, nominal for parts that the station does not hold."""
    parts = results.to_dataset()[terms.PART].values
    held_parts = results[terms.station_group(station)].to_dataset()[terms.STATION_PART].values
    positions = [parts.tolist().index(part) for part in held_parts]
    R = np.tile(np.eye(3), (len(R_held), len(terms.STATES), len(parts), 1, 1))
    t = np.zeros((len(R_held), len(terms.STATES), len(parts), 3))
    R[:, :, positions], t[:, :, positions] = R_held, t_held
    return R, t


def _labels(rows: xr.Dataset, dim: str, of_station: terms.ArchiveVariable, station: str) -> list[str]:
    return [str(name) for name in rows[dim].values[rows[of_station.name].values == station]]
