"""Declared models that came from a stranger's archive: rebuilt as they were, or refused with one message."""

import copy
import json
import math
import operator

import casadi as ca
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from scipy import stats

import tolcontact as tc
from tests import cases
from tests.helpers import FIXED, compiled, nightly
from tolcontact.archive.settings import declaration
from tolcontact.declaration.codec import EntryError, Place, Sources
from tolcontact.declaration.document import from_document
from tolcontact.declaration.measure import BINARY, UNARY, tape_of
from tolcontact.errors import ArchiveError, ModelError
from tolcontact.mechanics import measures as recording

DAMAGED = "^the declared model in the archive is damaged: "


def built(assembly):
    """The program of a model whose draws conflict, which takes long to find out where planes end."""
    return compiled(assembly, solver="daqp", method=FIXED)


@pytest.fixture(scope="module")
def document():
    return json.loads(declaration(built(cases.everything_of_boxes())))


def places(value, path=()):
    """The paths of all values of a document."""
    yield path
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, item in items:
        yield from places(item, (*path, key))


def changed(document, path, value):
    if not path:
        return value
    document = copy.deepcopy(document)
    *way, last = path
    holder = document
    for key in way:
        holder = holder[key]
    if value is Ellipsis:
        del holder[last]
    else:
        holder[last] = value
    return document


def test_a_document_is_rebuilt_as_it_was(document):
    rebuilt = from_document(document, {})
    again = json.loads(declaration(built(rebuilt)))
    assert again == document


def nested(depth):
    value = []
    for _ in range(depth):
        value = [value]
    return value


STRANGE = [
    ..., None, True, -1, 0, 10**400, 1e308, math.nan, math.inf, "", "x", "base", "\udce9", "a" * 10**6, [], {}, [1], [None] * 3,
    [math.nan] * 3, {"a": 1}, {"scipy": "test", "args": [], "kwds": {}}, nested(100_000),
]  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("stride", [17, *nightly(1)])
def test_whatever_stands_anywhere_in_a_document_ends_in_one_error(stride, document):
    """At each place every so many values: at the next place others."""
    accepted = 0
    for number, path in enumerate(places(document)):
        for value in STRANGE[number % stride :: stride]:
            if value is Ellipsis and not path:
                continue
            try:
                from_document(changed(document, path, value), {})
                accepted += 1  # some values say another model
            except ArchiveError as error:
                message = str(error)
                assert message.startswith(DAMAGED[1:]) and len(message) < 500 and message.isprintable()
    assert accepted


@pytest.mark.slow
@settings(max_examples=150, deadline=None, suppress_health_check=list(HealthCheck))
@given(data=st.data())
def test_two_strange_values_end_in_one_error_too(document, data):
    values = st.recursive(
        st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
        lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(max_size=5), inner, max_size=4),
    )
    for _ in range(2):
        path = data.draw(st.sampled_from(list(places(document))))
        document = changed(document, path, data.draw(values))
    try:
        from_document(document, {})
    except ArchiveError as error:
        assert str(error).startswith(DAMAGED[1:])


@pytest.mark.parametrize(
    "said",
    [
        {"scipy": "test", "args": [], "kwds": {}},
        {"scipy": "poisson", "args": [3], "kwds": {}},
        {"scipy": "rv_histogram", "args": [[1, 2]], "kwds": {}},
        {"scipy": "gaussian_kde", "args": [[1, 2]], "kwds": {}},
        {"scipy": "_distn_infrastructure", "args": [], "kwds": {}},
        {"scipy": "norm.fit", "args": [], "kwds": {}},
        {"scipy": "norm", "args": [0, math.nan], "kwds": {}},
        {"scipy": "norm", "args": [[0, 1], 1], "kwds": {}},
        {"scipy": "norm", "args": [0, 1], "kwds": {"moments": 3}},
        {"scipy": "norm", "args": [0, 1, 2, 3], "kwds": {}},
        {"scipy": "norm", "args": [0, 1], "kwds": {"scale": 2}},
        {"scipy": "norm", "args": [0], "kwds": {"scale": "1"}},
        {"scipy": "norm", "args": [0, -1], "kwds": {}},
        {"scipy": 3, "args": [], "kwds": {}},
        {"scipy": "beta", "args": [], "kwds": {}},
    ],
    ids=str,
)
def test_only_continuous_distributions_of_scipy_are_made(said, document, monkeypatch):
    monkeypatch.setattr(stats, "test", lambda *_, **__: pytest.fail("it was run"))
    with pytest.raises(ArchiveError, match=DAMAGED):
        from_document(changed(document, ("locations", 1, "tolerance"), said), {})


@pytest.mark.parametrize(
    "rows",
    [
        [],
        [["input"]],
        [["input", 42]],
        [["input", -1]],
        [["input", 0.0]],
        [["input", True]],
        [["const", "1"]],
        [["const", 1, 2]],
        [["const", 1.0], ["add", 0, 1]],
        [["const", 1.0], ["sin", -1]],
        [["const", 1.0], ["add", 0]],
        [["const", 1.0], ["system", 0]],
        [["const", 1.0], [["add"], 0, 0]],
        [["const", 1.0], []],
        [["const", 1.0], "add"],
        {"const": 1.0},
    ],
    ids=str,
)
def test_a_damaged_tape_is_refused(rows, document):
    with pytest.raises(ArchiveError, match=r"damaged: measures\[2\].tape"):
        from_document(changed(document, ("measures", 2, "tape"), rows), {})


def test_a_tape_may_not_be_endless():
    rows = [["input", 0], *(["twice", k] for k in range(1000))]
    with pytest.raises(EntryError, match="more than 1000 steps"):
        tape_of(rows, Place(Sources({}, inputs=1)), max_steps=1000)
    entries = ca.SX.sym("entries", 2)
    with pytest.raises(ValueError, match="cannot be archived"):
        recording.record(ca.sin(entries[0]) + ca.cos(entries[1]), entries, max_steps=3)


VALUES_OF_OPERATIONS = {
    "neg": operator.neg, "sq": lambda a: a * a, "twice": lambda a: 2 * a, "inv": lambda a: 1 / a, "assign": lambda a: a,
    "not": operator.not_, "sign": np.sign, "add": operator.add, "sub": operator.sub, "mul": operator.mul,
    "div": operator.truediv, "pow": math.pow, "constpow": math.pow, "lt": operator.lt, "le": operator.le, "eq": operator.eq,
    "ne": operator.ne,
    "and": lambda a, b: bool(a and b), "or": lambda a, b: bool(a or b), "fmin": min, "fmax": max,
    "if_else_zero": lambda a, b: b if a else 0.0,
}  # fmt: skip


@pytest.mark.parametrize("name", (*UNARY, *BINARY))
def test_every_operation_of_a_tape_can_be_replayed(name):
    """Its value is that of Python's own function; where that has no value, neither has the operation."""
    deviations, operands = ca.SX.sym("deviations", 2), (0,) if name in UNARY else (0, 1)
    tape = (("input", 0), ("input", 1), (name, *operands))
    replayed = ca.Function("replayed", [deviations], [recording.replay(tape, [], deviations)])
    expected = VALUES_OF_OPERATIONS.get(name) or getattr(math, name)
    for values in ((0.3, 0.7), (1.25, -2.5), (-2.5, 0.3), (0.3, 0.3), (0.0, 2.0)):
        found = float(replayed(values))
        try:
            assert found == pytest.approx(float(expected(*values[: len(operands)])), rel=1e-15, abs=1e-16), values
        except (ValueError, ZeroDivisionError):
            assert not math.isfinite(found), values


class Own(stats.rv_continuous):
    def _pdf(self, x):
        return 1.0 + 0.0 * x


@pytest.mark.parametrize(
    "own",
    [
        Own(a=0, b=1, name="own")(),
        Own(a=0, b=1, name="norm")(),
        stats.rv_histogram(np.histogram([1.0, 2.0, 2.0, 3.0])).freeze(),
        stats.norm([0, 1], 1),
        stats.uniform(0, scale=np.array([1.0])),
    ],
    ids=["own", "own with a known name", "histogram", "several at once", "array"],
)
def test_a_distribution_that_no_archive_can_hold_is_a_fault(own):
    a = cases.everything_of_boxes()
    a.locate(a.part("extra", tc.Box(1, 1, 1)), [], tolerance=own)
    with pytest.raises(ModelError, match=r"which an archive cannot store|expected finite numbers"):
        tc.build(a)


def test_all_of_scipys_continuous_distributions_are_rebuilt():
    for name in ("norm", "beta", "expon", "t", "truncnorm", "weibull_min", "triang"):
        distribution = getattr(stats, name)
        a = cases.everything_of_boxes()
        a.locate(a.part("extra", tc.Box(1, 1, 1)), [], tolerance=distribution(*[0.5] * distribution.numargs, scale=0.1))
        assert not [fault for fault in a.faults() if "archive" in fault], name
