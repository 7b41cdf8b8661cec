"""Fasteners in stations: the same as without stations, and kept by the joint of what they fasten."""

import numpy as np
import pytest

import tolcontact as tc
from tests.cases.fastened import held, hole, lying, placed, plate
from tests.helpers import simulate
from tolcontact.errors import ModelError
from tolcontact.poses import relative
from tolcontact.vocabulary import CORRECTED, RAW

PLACES = [(-45.0, 0.0), (45.0, 0.0)]
ALL_POINTS = tc.Method(objective="all points")


def bolted_plates(station="", *, into=False, inspects=False):
    """A cover that is free in its plane on a base, with two bolts; in a station, and then inspected as a joint."""
    a = tc.Assembly("bolted plates", method=ALL_POINTS)
    base = plate(a, "base", 0, dict.fromkeys(PLACES, 8.5 if into else 11.0))
    cover = plate(a, "cover", 1, dict.fromkeys(PLACES, 11.0))
    scene = a.station(station) if station else a
    scene.locate(base, held())
    scene.locate(cover, lying(), floating=True)
    bolts = []
    for k, place in enumerate(PLACES):
        lower, upper = hole(base, f"H{k}", place, placed(1.4)), hole(cover, f"H{k}", place, placed(1.4))
        holes = {"through": [upper], "into": lower} if into else {"through": [upper, lower]}
        bolts.append(tc.fasten(scene, f"bolt {k + 1}", 10, seat=cover.face("+z"), **holes))
    scene.measure("shift", cover.point(0, 0, 0), to=base.point(0, 0, 0), along="x")
    scene.measure("bolt", bolts[0].point(0, 0, 0), to=base.point(0, 0, 0), along="x")
    if inspects:
        stack = scene.join("stack", base, cover, *bolts)
        check = a.station("check")
        check.locate(stack, [tc.Locator(each.name, base.point(*each.point), each.direction, 0.5) for each in held()])
    return a


@pytest.mark.nightly
@pytest.mark.parametrize("choices", [{"into": True}, {}])
def test_a_station_fastens_as_an_assembly_without_stations_does(choices):
    (_, plain), (program, staged) = (simulate(bolted_plates(station, **choices), samples=40) for station in ("", "bench"))
    assert (staged["measured"] == plain["measured"]).all() and (staged["status"] == plain["status"]).all()
    assert np.ptp(plain["measured"][:, CORRECTED], axis=0).max() > 0.01
    assert all(part.station == "bench" for part in program.nominal.parts)


def test_a_joint_keeps_its_bolts_where_they_stood():
    model = bolted_plates("bench", into=True, inspects=True)
    program, run = simulate(model, samples=40)
    base, *others = model.parts

    def within(part, station):
        poses = (run["poses"][:, CORRECTED, program.nominal.part_index(body, station)] for body in (part, base))
        return relative(*poses)

    for part in others:
        assert np.abs(within(part, "check") - within(part, "bench")).max() < 1e-12
    assert np.ptp(run["measured"][:, CORRECTED, 0]) > 0.01 and np.abs(run["measured"][:, RAW, 0]).max() < 1e-9


def test_a_fastener_belongs_to_a_station():
    model = bolted_plates("bench")
    base, cover = model.parts[:2]
    with pytest.raises(ModelError, match=r'fastener "late" .*: it belongs to no station; declare it in one: tc\.fasten\(bench'):
        tc.fasten(model, "late", 5, through=[cover.features[3], base.features[3]])
