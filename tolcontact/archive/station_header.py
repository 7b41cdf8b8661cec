"""The groups of stations in the header of an archive."""

from collections.abc import Sequence

import netCDF4

from tolcontact import vocabulary as terms
from tolcontact.archive.rows import Row
from tolcontact.archive.variables import add, define
from tolcontact.discretization import Nominal


def write_stations(file: netCDF4.Dataset, nominal: Nominal, rows: Sequence[Row]) -> None:
    """Write the station of each measure, pair and part, and define the variables of each station; nothing without stations."""
    if not nominal.scenes:
        return
    add(file, terms.MEASURE_STATION, [measure.station for measure in nominal.measures])
    add(file, terms.PAIR_STATION, [nominal.parts[pair.moving].station for pair in nominal.pairs])
    add(file, terms.PART_STATION, [part.station for part in nominal.last_parts])
    for scene in nominal.scenes:
        path = terms.station_group(scene.station)
        group = file.createGroup(path)
        group.setncattr("station", scene.station)
        group.createDimension(terms.STATION_PART, len(scene.assembly.parts))
        add(group, terms.STATION_PART_LABEL, [part.name for part in scene.assembly.parts])
        for row in rows:
            if row.group == path:
                define(group, row.variable)
