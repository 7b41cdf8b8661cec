"""Variables of an archive with stations: those of the groups station/NAME, and what belongs to which station."""

from tolcontact.vocabulary.archive import ROTATION, STATUS, TRANSLATION, group_of
from tolcontact.vocabulary.labels import (
    label,
    variable,
)

STATIONS_GROUP, STATION_PART = "station", "station_part"

MEASURE_STATION = variable("str measure_station(measure)", "station in which a measure is taken")
PAIR_STATION = variable("str pair_station(pair)", "station in which a pair may touch")
PART_STATION = variable("str part_station(part)", "last station that holds a part, to which its pose belongs")
OF_STATIONS = (MEASURE_STATION, PAIR_STATION, PART_STATION)

STATION_PART_LABEL = label(STATION_PART, "part in the station")
STATION_TRANSLATION = variable(
    "f8 station_translation(realization, state, station_part, axis)", f"{TRANSLATION.long_name}; in the station", "mm"
)
STATION_ROTATION = variable(
    "f8 station_rotation(realization, state, station_part, axis, body_axis)", f"{ROTATION.long_name}; in the station", "1"
)
STATION_STATUS = variable(
    "i1 station_status(realization)", "outcome of the realization in the station", None, STATUS.attributes
)
STATION_POSES = (STATION_TRANSLATION, STATION_ROTATION)
STATION_ROWS = (*STATION_POSES, STATION_STATUS)


def station_group(station: str) -> str:
    """Return the path of a station's group."""
    return f"{STATIONS_GROUP}/{group_of(station)}"
