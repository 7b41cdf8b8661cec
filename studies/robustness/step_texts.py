"""Texts of hostile STEP files: a sound one at random damaged, and some that are sound in part, deep, circular or very large."""

import random
import re
from collections.abc import Callable, Iterator

from tests.step_files import Step

NUMBERS = (b"1.E308", b"-1.E308", b"NAN", b"INF", b"1.E-308", b"1.E400", b"0.", b"-0.", b"1", b"99999999999999999999")
NUMBER = re.compile(rb"(?<=[(,])-?\d+\.\d*(?:E-?\d+)?(?=[,)])")
REFERENCE = re.compile(rb"#\d+(?=[,)])")
FLATNESS = "#%d=FLATNESS_TOLERANCE('','',#%d,#%d);"
AP242 = b"AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }"


def damaged(text: bytes, rng: random.Random) -> tuple[str, bytes]:
    """Return a kind of damage, and a STEP file with it."""
    kind = rng.choice(("bytes", "cut", "lines twice", "lines lost", "numbers", "references"))
    start, count = rng.randrange(len(text)), rng.choice((1, 3, 20))
    lines = text.splitlines(keepends=True)
    rotten = bytearray(text)
    match kind:
        case "bytes":
            for _ in range(count):
                rotten[rng.randrange(len(text))] = rng.randrange(256)
        case "cut":
            del rotten[start:]
        case "lines twice" | "lines lost":
            line = rng.randrange(len(lines))
            lines[line : line + count] = lines[line : line + count] * (2 if kind == "lines twice" else 0)
            rotten = bytearray(b"".join(lines))
        case "numbers":
            rotten = _replaced(text, NUMBER, count, rng, lambda: rng.choice(NUMBERS))
        case "references":
            numbers = REFERENCE.findall(text)
            rotten = _replaced(text, REFERENCE, count, rng, lambda: rng.choice(numbers))
    return kind, bytes(rotten)


def _replaced(text: bytes, pattern: re.Pattern[bytes], count: int, rng: random.Random, new: Callable[[], bytes]) -> bytearray:
    """Return a text in which some matches of a pattern are replaced."""
    rotten = bytearray(text)
    matches = list(pattern.finditer(text))
    for match in sorted(rng.sample(matches, min(count, len(matches))), key=lambda match: -match.start()):
        rotten[match.start() : match.end()] = new()
    return rotten


def hostile(text: bytes) -> Iterator[tuple[str, str, bytes]]:
    """Yield a kind, the name of a file and its content for each way to be hostile. `text` is a sound file."""
    sound = text.replace(b"AUTOMOTIVE_DESIGN { 1 0 10303 214 1 1 1 1 }", AP242)
    head, data = sound.partition(b"DATA;\n")[::2]
    data = data.rpartition(b"ENDSEC;")[0]

    def with_records(*records: str) -> bytes:
        return b"".join([head, b"DATA;\n", data, "\n".join(records).encode(), b"\nENDSEC;\nEND-ISO-10303-21;\n"])

    for depth in (1000, 100_000):
        nested = "(" * depth + "1." + ")" * depth
        yield f"{depth} parentheses, nested", "a.step", with_records(f"#9001=SHAPE_ASPECT('',{nested},#4,.T.);")
        yield f"{depth} parentheses, open", "a.step", with_records(f"#9001=FLATNESS_TOLERANCE('',{'(' * depth},#4,#4);")
    yield "an assembly in itself", "a.step", _assembly([(0, 0)])
    yield "two assemblies in each other", "a.step", _assembly([(0, 1), (1, 0)])
    yield "an assembly in itself, and in another one", "a.step", _assembly([(0, 1), (1, 1), (0, 2)])
    yield "a chain of 3000 assemblies", "a.step", _assembly([(k, k + 1) for k in range(3000)])
    yield "2^30 places of a part", "a.step", _assembly([(k, k + 1) for k in range(30) for _ in range(2)])
    yield "shape aspects in a circle", "a.step", with_records(*_circle(1000))
    for entity in ("DIRECTION('',(0.,0.,1.))", "SHAPE_ASPECT('','',#4,.T.)", "PRODUCT('a','a','',(#8))", "X()"):
        records = (f"#{number}={entity};" for number in range(10_000, 1_010_000))
        yield f"a million records {entity.partition('(')[0]}", "a.step", with_records(*records)
    points = (f"#{number}=CARTESIAN_POINT('',({number}.,0.,1.));" for number in range(10_000, 1_010_000))
    yield "a million points", "a.step", with_records(*points)
    yield "a million tolerances", "a.step", with_records(*(FLATNESS % (k, 4, 4) for k in range(10_000, 1_010_000)))
    yield from _sections(sound, with_records)
    yield from _names(sound, data)


def _sections(sound: bytes, with_records: Callable[..., bytes]) -> Iterator[tuple[str, str, bytes]]:
    """Yield files whose sections, strings or comments do not begin or end as they should."""
    yield "a string without its end", "a.step", with_records("#9001=SHAPE_ASPECT('no end,#4,.T.);")
    yield "a comment without its end", "a.step", with_records("/* no end")
    yield "comments in comments", "a.step", with_records("/* /* */ */")
    yield "without any ENDSEC", "a.step", sound.replace(b"ENDSEC;", b"")
    yield "without HEADER", "a.step", sound[:13] + sound[sound.index(b"DATA;") :]
    section = sound[sound.index(b"DATA;") : sound.rindex(b"END-ISO")]
    yield "DATA twice", "a.step", sound.replace(section, section * 2)
    yield "DATA twice, the second one empty", "a.step", sound.replace(section, section + b"DATA;\nENDSEC;\n")
    yield "DATA twice, the first one empty", "a.step", sound.replace(section, b"DATA;\nENDSEC;\n" + section)
    yield "two files in one", "a.step", sound * 2
    yield "more after the end", "a.step", sound + b"\0" * 100_000
    yield "nothing but semicolons", "a.step", b"ISO-10303-21;" + b";" * 10_000_000 + b"END-ISO-10303-21;"
    yield "nothing but quotes", "a.step", b"ISO-10303-21;" + b"'" * 10_000_000 + b"END-ISO-10303-21;"
    yield "in UTF-16", "a.step", sound.decode().encode("utf-16")
    yield "with a byte order mark", "a.step", b"\xef\xbb\xbf" + sound


def _names(sound: bytes, data: bytes) -> Iterator[tuple[str, str, bytes]]:
    """Yield files with strange names of bodies and faces, and files that have strange names themselves."""
    texts = {
        "10 MB": b"a" * 10_000_000, "in X2": rb"\X2\00C4043096FB\X0\ \X\C4 \S\D", "in X4": rb"\X4\0001F600\X0\,",
        "in X2 without its end": rb"\X2\00C4", "in a wrong X2": rb"\X2\D800\X0\ \X2\ZZZZ\X0\ ", "in UTF-8": "Ä電".encode(),
        "in Latin-1": b"\xc4\xd6", "of control codes": b"\x1b[31m\x07\x00\r\n", "of quotes": b"''" * 100,
        "of backslashes": b"\\" * 101, "of markup": b"[bold]<script>&lt;{{%s}}",
    }  # fmt: skip
    for kind, text in texts.items():
        at = data.index(b"ADVANCED_FACE(''") + len(b"ADVANCED_FACE('")
        content = sound.replace(data, data[:at] + text + data[at:])
        yield f"names {kind}", "a.step", content.replace(b"PRODUCT('COMPOUND','COMPOUND'", b"PRODUCT('%b','%b'" % (text, text))
    for name in (
        "two words.step",
        "Ä電.step",
        "-a.step",
        "a\nb.step",
        "a'\"b.step",
        "[a]{b}%s.STP",
        "a" * 200 + ".step",
        ".step",
    ):
        yield f"file {name[:20]!r}", name, sound


def _assembly(uses: list[tuple[int, int]]) -> bytes:
    """Return a file in which product 0, a block, and others are used in products: pairs of a child's and a parent's number."""
    step = Step()
    block = step.product("block", [step.solid((0, 0, 0), (10, 20, 30))])
    count = 1 + max(map(max, uses))
    products = [block, *(step.product(f"product {number}") for number in range(1, count))]
    for number, (child, parent) in enumerate(uses):
        step.place(products[child], products[parent], f"use {number}", (number, 0, 0))
    return str(step).encode()


def _circle(count: int) -> Iterator[str]:
    """Yield shape aspects of which each consists of the next one, and tolerances of some."""
    for k in range(count):
        yield f"#{10_000 + k}=SHAPE_ASPECT('','',#4,.T.);"
        yield f"#{20_000 + k}=SHAPE_ASPECT_RELATIONSHIP('','',#{10_000 + k},#{10_000 + (k + 1) % count});"
        yield FLATNESS % (30_000 + k, 4, 10_000 + k)
    yield "#9001=GEOMETRIC_ITEM_SPECIFIC_USAGE('','',#10000,#10,#17);"
