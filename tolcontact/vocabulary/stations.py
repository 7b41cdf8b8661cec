"""Variables of an archive with stations: those of the groups station/NAME, and what belongs to which station."""

from tolcontact.vocabulary.archive import ROTATION, STATUS, TRANSLATION, group_of
from tolcontact.vocabulary.labels import AXIS, BODY_AXIS, MEASURE, PAIR, PART, REALIZATION, STATE, ArchiveVariable, label

STATIONS_GROUP, STATION_PART = "station", "station_part"

MEASURE_STATION = ArchiveVariable("measure_station", (MEASURE,), str, "station in which a measure is taken")
PAIR_STATION = ArchiveVariable("pair_station", (PAIR,), str, "station in which a pair may touch")
PART_STATION = ArchiveVariable("part_station", (PART,), str, "last station that holds a part, to which its pose belongs")
OF_STATIONS = (MEASURE_STATION, PAIR_STATION, PART_STATION)

STATION_PART_LABEL = label(STATION_PART, "part in the station")
STATION_TRANSLATION = ArchiveVariable(
    "station_translation", (REALIZATION, STATE, STATION_PART, AXIS), "f8", f"{TRANSLATION.long_name}; in the station", "mm"
)
STATION_ROTATION = ArchiveVariable(
    "station_rotation", (REALIZATION, STATE, STATION_PART, AXIS, BODY_AXIS), "f8", f"{ROTATION.long_name}; in the station", "1"
)
STATION_STATUS = ArchiveVariable(
    "station_status", (REALIZATION,), "i1", "outcome of the realization in the station", None, STATUS.attributes
)
STATION_POSES = (STATION_TRANSLATION, STATION_ROTATION)
STATION_ROWS = (*STATION_POSES, STATION_STATUS)


def station_group(station: str) -> str:
    """Return the path of a station's group."""
    return f"{STATIONS_GROUP}/{group_of(station)}"
