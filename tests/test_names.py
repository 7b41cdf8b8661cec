"""Names: what would steer a terminal is refused, everything else may be said."""

import pytest

import tolcontact as tc
from tolcontact.errors import ArchiveError, ModelError, TolcontactError

CONTROL_CHARACTERS = [
    "\x00", "\x07", "\t", "\n", "\x1b[31m", "\x7f", "\x85", "\x9b", "\u2028", "\u2029", "\u202a", "\u202e", "\u2066",
    "\u2069", "\ud800", "\udce9",
]  # fmt: skip
FINE = [
    "part",
    "axis",
    "realization",
    "Grundplatte oben",
    "Größe Ø 5",
    "部品",
    "деталь",
    "क्षेत्र",
    "a 👨‍👩‍👧 family",
    "a.b",
    "1st [red]",
    "שלום",
]


def model(name="fine", **names) -> tc.Assembly:
    said = {"part": "block", "locator": "L0", "pair": "joint", "measure": "height", "force": "push", "units": "mm"} | names
    a = tc.Assembly(name)
    floor = a.part("floor", tc.Box(10, 10, 10), at=(0, 0, -10), fixed=True)
    block = a.part(said["part"], tc.Box(10, 10, 10))
    points = [(1, 1, 0), (9, 1, 0), (5, 9, 0), (1, 0, 5), (9, 0, 5), (0, 5, 5)]
    labels = [said["locator"], *(f"L{k}" for k in range(1, 6))]
    a.locate(block, [tc.Locator(*one, 1) for one in zip(labels, points, "zzzyyx", strict=True)])
    a.contact(said["pair"], moving=block.face("-z"), reference=floor.face("+z"), points=4)
    corner = block.point(0, 0, 0)
    if said["units"] == "mm":
        a.measure(said["measure"], corner, along="z")
    else:  # which only a function may have
        a.measure(said["measure"], lambda poses: poses.position(corner)[2], units=said["units"])
    a.force(said["force"], at=block.point(0, 0, 0), vector=(0, 0, -1))
    return a


KINDS = {
    "name": "assembly",
    "part": "part",
    "locator": "locator",
    "pair": "contact pair",
    "measure": "measurement",
    "force": "force",
}


@pytest.mark.parametrize("word", [*KINDS, "units"])
def test_what_steers_a_terminal_is_refused(word):
    for bad in CONTROL_CHARACTERS:
        with pytest.raises(ModelError) as refused:
            tc.build(model(**{word: f"a{bad}b"}))
        message = str(refused.value)
        assert "control character" in message and message.translate({9: " ", 10: " "}).isprintable(), repr(bad)
        assert word == "units" or f"{KINDS[word]} {f'a{bad}b'!r}: a name must be text" in message


@pytest.mark.parametrize("word", [*KINDS, "units"])
def test_everything_else_may_be_said(word):
    for name in FINE:
        assert not list(model(**{word: name}).faults()), name


@pytest.mark.parametrize("word", ["name", "locator", "part"])
def test_a_name_is_a_text(word):
    with pytest.raises(ModelError, match="a name must be text"):
        tc.build(model(**{word: 3}))


def test_names_of_the_same_letters_are_the_same_name():
    composed, decomposed = "Größe", "Gro\u0308ße"
    a = model(part=composed, locator=composed)
    a.part(decomposed, tc.Box(1, 1, 1), fixed=True)
    assert any(f'part "{composed}" is declared 2 times' in fault for fault in a.faults())
    locator = [tc.Locator(name, (0, 0, 0), "z", 1) for name in (composed, decomposed)]
    b = model()
    b.locate(b.part("other", tc.Box(1, 1, 1)), locator)
    assert any(f'locator "{composed}" is declared 2 times' in fault for fault in b.faults())


def test_no_message_steers_a_terminal():
    for kind in (TolcontactError, ArchiveError):
        assert str(kind('"mod\udce9l.py\x1b[2J" is\nwrong')) == '"mod\\udce9l.py\\x1b[2J" is\nwrong'
