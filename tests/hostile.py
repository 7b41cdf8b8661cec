"""Archives that nobody should believe: made from a good one, each with one lie. For tests, and for trials with many."""

import json
import shutil

import netCDF4
import numpy as np

ESCAPE = "\x1b]0;owned\x07"


def _declared(file, change):
    stored = file["model/declaration"]
    stored.set_auto_chartostring(False)
    document = json.loads(stored[...].tobytes().rstrip(b"\0"))
    text = change(document) if callable(change) else change
    text = text if isinstance(text, str) else json.dumps(document if text is None else text)
    room = stored.shape[0]
    encoded = text.encode()
    if len(encoded) > room:  # another variable, of that length, in its place
        file["model"].renameVariable("declaration", "old")
        file["model"].createDimension("longer", len(encoded))
        stored = file["model"].createVariable("declaration", "S1", ("longer",))
        stored.setncattr("_Encoding", "utf-8")
        stored.set_auto_chartostring(False)
        room = len(encoded)
    stored[...] = np.frombuffer(encoded.ljust(room, b"\0"), "S1")


def _distribution(name, args=(), kwds=None):
    def change(document):
        scheme = document["locations"][0]
        scheme["tolerance"] = {"scipy": name, "args": list(args), "kwds": kwds or {}}

    return lambda file: _declared(file, change)


def _without(*path):
    def change(document):
        at = document
        for step in path[:-1]:
            at = at[step]
        del at[path[-1]]

    return lambda file: _declared(file, change)


def _with(value, *path):
    def change(document):
        at = document
        for step in path[:-1]:
            at = at[step]
        at[path[-1]] = value

    return lambda file: _declared(file, change)


def _renamed(kind, name, new):
    def change(file):
        group = file
        for step in name.split("/")[:-1]:
            group = group[step]
        getattr(group, f"rename{kind}")(name.split("/")[-1], new)

    return change


def _tape(steps):
    def change(document):
        document["measures"][0].pop("of")
        document["measures"][0]["tape"] = steps

    return lambda file: _declared(file, change)


def _claims(size, name="vast", dims=1, size_name="vastness"):
    """A variable of a size that no disk holds, of which nothing was ever written."""

    def change(file):
        file.createDimension(size_name, size)
        file.createVariable(name, "f8", (size_name,) * dims, chunksizes=(1000,) * dims)

    return change


def _grown(name, at):
    """One value far behind the end: a file of little bytes claims many realizations."""

    def change(file):
        file[name][at : at + 1] = 0

    return change


def _attribute(word, value):
    return lambda file: file.setncattr(word, value)


def _attribute_of(name, word, value):
    return lambda file: file[name].setncattr(word, value)


def _label(name, text):
    def change(file):
        stored = file[name]
        stored.set_auto_chartostring(False)
        encoded = text.encode("utf-8", "surrogatepass")[: stored.shape[1]]
        stored[0] = np.frombuffer(encoded.ljust(stored.shape[1], b"\0"), "S1")

    return change


def _compound(file):
    kind = file.createCompoundType(np.dtype([("a", "f8"), ("b", "i4")]), "pairs")
    file.createVariable("measured_too", kind, ("part",))


def _free_length(file):
    file.createVariable("notes", file.createVLType("f8", "ragged"), ("part",))


def _other_type(name, kind):
    def change(file):
        dims = file[name].dimensions
        file.renameVariable(name, "old")
        file.createVariable(name, kind, dims)

    return change


def _other_dims(name, dims):
    def change(file):
        kind = file[name].dtype
        file.renameVariable(name, "old")
        file.createVariable(name, kind, dims)

    return change


def _deep_groups(file):
    group = file
    for _ in range(300):
        group = group.createGroup("g")


def _many_groups(file):
    for k in range(2000):
        file.createGroup(f"model/mesh/g{k}")


HOSTILE = {
    "runs tests": _distribution("test"),
    "runs a module's function": _distribution("bootstrap", [1.0]),
    "is no continuous distribution": _distribution("poisson", [1.0]),
    "is a base class": _distribution("rv_continuous", [1.0]),
    "is a module": _distribution("distributions"),
    "is dunder": _distribution("__import__"),
    "is dunder call": _distribution("__builtins__"),
    "has text arguments": _distribution("norm", ["0"]),
    "has nested arguments": _distribution("norm", [[0, 1]]),
    "has endless arguments": _distribution("norm", [float("inf"), float("nan")]),
    "has unknown keywords": _distribution("norm", [], {"seed": 1}),
    "has text keywords": _distribution("norm", [], {"loc": "os.system"}),
    "has too many arguments": _distribution("norm", [1.0] * 50),
    "name is a number": _distribution(7),
    "is deep": lambda file: _declared(file, "[" * 100_000 + "]" * 100_000),
    "is deep inside": _with(json.loads("[" * 900 + "]" * 900), "parts", 0, "at"),
    "has a huge number": lambda file: _declared(file, '{"name": ' + "9" * 10_000 + "}"),
    "is a list": lambda file: _declared(file, "[]"),
    "is a number": lambda file: _declared(file, "1"),
    "is null": lambda file: _declared(file, "null"),
    "is empty": lambda file: _declared(file, ""),
    "is text": lambda file: _declared(file, '"assembly"'),
    "is cut off": lambda file: _declared(file, '{"name": "RA1", "parts": ['),
    "is no UTF-8": lambda file: file["model/declaration"].__setitem__(slice(0, 2), np.array([b"\xff", b"\xfe"])),
    "has no name": _without("name"),
    "has no parts": _without("parts"),
    "has no locations": _without("locations"),
    "has no pairs": _without("pairs"),
    "has no measures": _without("measures"),
    "has no forces": _without("forces"),
    "part has no name": _without("parts", 0, "name"),
    "part has no geometry": _without("parts", 0, "geometry"),
    "part has no place": _without("parts", 0, "at"),
    "pair has no face": _without("pairs", 0, "moving"),
    "measure has no point": _without("measures", 0, "of"),
    "parts is a number": _with(7, "parts"),
    "parts is a text": _with("parts", "parts"),
    "part is a text": _with("part", "parts", 0),
    "part is null": _with(None, "parts", 0),
    "name is a list": _with([], "parts", 0, "name"),
    "name is a dict": _with({}, "parts", 0, "name"),
    "name is an escape": _with(ESCAPE, "parts", 0, "name"),
    "assembly name is an escape": _with(ESCAPE, "name"),
    "assembly name turns": _with("a\u202eb", "name"),
    "box has two sides": _with({"box": [1, 2]}, "parts", 0, "geometry"),
    "box has text sides": _with({"box": ["1", "2", "3"]}, "parts", 0, "geometry"),
    "box is endless": _with({"box": [1e308, 1e308, float("inf")]}, "parts", 0, "geometry"),
    "geometry is unknown": _with({"script": "x"}, "parts", 0, "geometry"),
    "mesh is missing": _with({"mesh": "lid.stl"}, "parts", 0, "geometry"),
    "mesh is a path": _with({"mesh": "/etc/passwd"}, "parts", 0, "geometry"),
    "place has four numbers": _with([1, 2, 3, 4], "parts", 0, "at"),
    "place is a text": _with("origin", "parts", 0, "at"),
    "unknown part in a pair": _with("nobody", "pairs", 0, "moving", "part"),
    "unknown part in a location": _with("nobody", "locations", 0, "part"),
    "unknown part in a measure": _with("nobody", "measures", 0, "of", "part"),
    "triangles are texts": _with(["0"], "pairs", 0, "moving", "triangles"),
    "inside is flat": _with([[1]], "pairs", 0, "moving", "inside"),
    "scheme is a number": _with(6, "locations", 0, "scheme"),
    "scheme has one face": _with({"three_two_one": [], "inset": 1}, "locations", 0, "scheme"),
    "points is a dict": _with({}, "pairs", 0, "points"),
    "points is huge": _with(10**18, "pairs", 0, "points"),
    "tape calls": _tape([["__import__", 0]]),
    "tape is endless": _tape([[10**9, 10**9]]),
    "units are an escape": _with(ESCAPE, "measures", 0, "units"),
    "tolerance is a list": _with([], "measures", 0, "tolerance"),
    "declared_at is an escape": _with(ESCAPE, "measures", 0, "declared_at"),
    "title is an escape": _attribute("title", f"simulation of {ESCAPE}"),
    "title turns": _attribute("title", "\u202esimulation"),
    "title is a number": _attribute("title", 7),
    "title is long": _attribute("title", "x" * 3_000_000),
    "history is an escape": _attribute("history", ESCAPE),
    "attribute name is an escape": _attribute("a\u202eb", "x"),
    "format is newer": _attribute("format", np.int64(99)),
    "no format": lambda file: file.delncattr("format"),
    "format is a text": _attribute("format", "two"),
    "format is negative": _attribute("format", np.int64(-1)),
    "accuracy is a text": _attribute("solver_accuracy", "1e-8"),
    "samples is a text": _attribute("samples", "many"),
    "samples is negative": _attribute("samples", np.int64(-5)),
    "samples are a list": _attribute("samples", [1, 2, 3]),
    "resolution is a number": _attribute("resolution", 1),
    "label is an escape": _label("part", "\x1b[2Jx"),
    "label is a C1 code": _label("part", "\x9b2Jx"),
    "label is empty": _label("part", ""),
    "label is no UTF-8": lambda file: file["part"].set_auto_chartostring(False) or file["part"].__setitem__((0, 0), b"\xff"),
    "two labels are one": _label("part", "top"),
    "claims 1e12 values": _claims(10**12),
    "claims 1e24 values": _claims(10**12, dims=2),
    "claims a coordinate": _claims(10**12, name="far", size_name="far"),
    "claims 1e9 realizations": _grown("realization", 10**9),
    "claims 1e12 realizations": _grown("status", 10**12),
    "compound type": _compound,
    "type of free length": _free_length,
    "status is text": _other_type("status", "S1"),
    "measured is text": _other_type("measured", str),
    "gap_min has no state": _other_dims("gap_min", ("realization", "pair")),
    "status by part": _other_dims("status", ("part",)),
    "no status": _renamed("Variable", "status", "statu"),
    "no measured": _renamed("Variable", "measured", "measure_d"),
    "no sample": _renamed("Group", "sample", "samples"),
    "no model": _renamed("Group", "model", "models"),
    "no contact": _renamed("Group", "contact", "contacts"),
    "no field of a part": _renamed("Group", "field/top", "tap"),
    "no declaration": _renamed("Variable", "model/declaration", "said"),
    "no vertices": _renamed("Variable", "field/top/vertices", "points"),
    "no units": _renamed("Variable", "measure_units", "unit"),
    "no limits": _renamed("Variable", "measure_lower_limit", "limit"),
    "no share of touching": _renamed("Variable", "contact/touching", "touch"),
    "no check of surfaces": _renamed("Variable", "surface/beside", "besides"),
    "no ranges": _renamed("Variable", "sample/tolerance_range", "ranges"),
    "states are others": _label("state", "rav"),
    "a state is missing": _renamed("Variable", "state", "stat"),
    "scaled": _attribute_of("measured", "scale_factor", 2.0),
    "shifted": _attribute_of("measured", "add_offset", 1.0),
    "masked": _attribute_of("measured", "missing_value", 0.0),
    "times": _attribute_of("measured", "units", "days since 1970-01-01"),
    "encoded as nothing": _attribute_of("part", "_Encoding", "no-such-code"),
    "deep groups": _deep_groups,
    "many groups": _many_groups,
    "group is an escape": lambda file: file.createGroup("a\u202eb"),
    "statuses without a meaning": lambda file: file["status"].__setitem__(slice(5, 9), 99),
    "iterations are huge": lambda file: file["iterations"].__setitem__(slice(5, 9), 2_000_000_000),
    "iterations are negative": lambda file: file["iterations"].__setitem__(slice(5, 9), -7),
    "measured is endless": lambda file: file["measured"].__setitem__(slice(5, 9), np.inf),
    "no sums": _renamed("Variable", "field/top/sums", "sum_s"),
    "realizations are more": _attribute("realizations", np.int64(10**9)),
    "summed rows are huge": lambda file: file["summed_rows"].__setitem__(..., 10**15),
    "summed rows are negative": lambda file: file["summed_rows"].__setitem__(..., -(10**15)),
}  # fmt: skip


def make(source, path, name):
    """An archive at `path`, like `source` with one lie."""
    shutil.copyfile(source, path)
    with netCDF4.Dataset(path, "r+") as file:
        HOSTILE[name](file)
