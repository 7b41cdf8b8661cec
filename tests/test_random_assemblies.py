"""Small assemblies at random: whatever is declared, every realization has a status, and what it certifies is true."""

import itertools

import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, event, given, settings, strategies as st

import tolcontact as tc
from studies.certificates.polyhedra import Polyhedron, relative, separation
from tests import referee
from tests.helpers import R_t, nightly, simulate
from tolcontact.compilation import ACCURACY
from tolcontact.method import OBJECTIVES
from tolcontact.vocabulary import CORRECTED, RAW, Status

pytestmark = pytest.mark.slow

ALLOWED = 5e-4  # of the smallest tolerance range: penetration that a certificate allows

lengths = st.floats(2, 50)
ranges = st.sampled_from([0.0, 0.01, 0.1, 1.0])


@st.composite
def assemblies(draw) -> tc.Assembly:
    """A row of up to four boxes along x, each against the one before; some are fixed, some stand on others or have supports."""
    a = tc.Assembly("random")
    boxes, x, movers = [], 0.0, {}
    for k in range(draw(st.integers(2, 4))):
        size = [draw(lengths), *(draw(lengths) + 10 * k for _ in range(2))]  # each against a larger one: few overhangs
        part = a.part(
            f"box{k}",
            tc.Box(*size),
            at=(x, draw(st.floats(-0.5, 0.5)), draw(st.floats(-0.5, 0.5))),
            fixed=draw(st.sampled_from([False, False, k % 2 == 0])),
        )
        x += size[0] - draw(st.sampled_from([0.0, 0.0, -0.1, 0.1]))
        sx, sy, sz = size
        one_sided = draw(st.booleans())
        z = draw(ranges)
        feet = [
            tc.Locator(f"A{i}", p, "z", z, one_sided=one_sided) for i, p in enumerate([(0, 0, 0), (sx, 0, 0), (sx / 2, sy, 0)])
        ]
        if one_sided and draw(st.booleans()):
            feet.append(tc.Locator("A4", (0, sy, 0), "z", z, one_sided=True))
        y, along = draw(ranges), draw(ranges)
        sides = [
            tc.Locator("B1", (0, 0, sz / 2), "y", y),
            tc.Locator("B2", (sx, 0, sz / 2), "y", y),
            tc.Locator("C", (0, sy / 2, sz / 2), "x", along),
        ]
        on = draw(st.sampled_from([None, None, *boxes])) if boxes else None
        a.locate(part, [*feet, *sides], on=on)
        boxes.append(part)
        movers[part] = movers.get(on) if part.fixed else part  # None: the ground
    for k, (left, right) in enumerate(itertools.pairwise(boxes)):
        sides = [left.face("+x"), right.face("-x")]
        if left.fixed or (not right.fixed and draw(st.booleans())):
            sides.reverse()
        moving, reference = (side.part.geometry for side in sides)
        is_small = moving.y + 4 < reference.y and moving.z + 4 < reference.z
        points = draw(st.sampled_from([1, 5, 30])) if is_small else None  # few points may all overhang
        if movers[left] != movers[right]:
            a.contact(f"joint{k}", moving=sides[0], reference=sides[1], points=points, within=5.0)
    for pair in a.pairs:
        pushed = pair.moving.part
        if pushed.fixed is None:
            a.force(f"push{pair.name}", at=pushed.point(1, 1, 1), vector=(-1.0, 0.0, -2.0))
    a.measure("end", boxes[-1].point(0, 0, 0), along="x", tolerance=1)
    return a


@given(
    assembly=assemblies(),
    solver=st.sampled_from(["qpoases", "daqp"]),
    resolution=st.sampled_from(["exact", "exact", "linearized"]),
    objective=st.sampled_from(tuple(OBJECTIVES)),
    search=st.sampled_from(["fixed", "bounded"]),
)
def judge(assembly, solver, resolution, objective, search):
    """Resolve a random assembly, and check what its statuses certify."""
    method = tc.Method(resolution=resolution, objective=objective, search=search if resolution == "exact" else "fixed")
    try:
        program, run = simulate(assembly, samples=20, solver=solver, method=method)
    except tc.TolcontactError as error:
        # Nothing presses where no contact pair has a force, and few points may all overhang; all else is meant to be simulated.
        few = [f'"{pair.name}"' for pair in assembly.pairs if pair.points in (1, 5)]
        faults = getattr(error, "faults", (str(error),))
        overhang = all("overhangs the rim" in fault and any(name in fault for name in few) for fault in faults)
        assert overhang or (objective == "seating" and "force" in str(error)), error
        event("refused")
        return
    event(f"{resolution}, {objective}: {sorted({Status(s).name for s in run['status']})}")
    for name, values in run.items():
        assert not np.isnan(values).any(), name
    status = run["status"]
    assert np.isin(status, list(Status)).all()
    accuracy = ACCURACY
    penetration = -run["gap_min"][:, CORRECTED].min(axis=1, initial=np.inf)
    resolved, untouched = status == Status.RESOLVED, status == Status.UNTOUCHED
    assert (run["kkt_residual"][resolved] <= accuracy).all()
    assert (run["poses"][untouched, CORRECTED] == run["poses"][untouched, RAW]).all()
    assert (run["reaction"] >= 0).all()
    assert (run["iterations"][~untouched] > 0).all()
    if resolution == "exact":
        assert (penetration[resolved] <= accuracy).all()
        R, _ = R_t(run["poses"][:, CORRECTED])
        assert np.abs(R @ R.swapaxes(-1, -2) - np.eye(3)).max() < 1e-12
        assert (penetration[status == Status.NOT_ASSEMBLABLE] > accuracy).all()
    R, t = R_t(run["poses"])
    for index, pair in enumerate(program.nominal.pairs):
        if index in program.meetings:  # bodies that end: no two of them penetrate each other
            bodies = [Polyhedron(np.array(program.nominal.parts[part].body.vertices)) for part in (pair.moving, pair.reference)]
            certified = np.flatnonzero(resolved | untouched)
            relative_poses = relative(run["poses"][certified, CORRECTED], pair.moving, pair.reference)
            depth = -separation(*bodies, *relative_poses)
            assert depth.max(initial=0) <= ALLOWED * assembly.smallest_zone()
        elif not pair.is_supports:  # the archived least gaps are those of the archived poses, by the paper's formula
            for k in range(20):
                least = referee.gaps(pair, R[k, CORRECTED], t[k, CORRECTED]).min()
                assert least == pytest.approx(run["gap_min"][k, CORRECTED, index], rel=1e-9, abs=1e-9)


SETTINGS = {"deadline": None, "derandomize": True, "suppress_health_check": list(HealthCheck), "phases": [Phase.generate]}


@pytest.mark.parametrize("examples", [8, *nightly(110)])
def test_certificates_hold(examples):
    settings(max_examples=examples, **SETTINGS)(judge)()
