"""The tolerances of a test case of NIST, read from its STEP file."""

import gzip
import re
import tempfile
from pathlib import Path

import numpy as np

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import FOLDER, numbers

N = numbers(__file__)
FILE = FOLDER.parent / "cad" / "nist_ctc_01_asme1_ap242-e1.stp.gz"


def solution():
    widths = [N.position, N.position, N.profile, N.around, N.square, N.flat]
    return len(widths), sum(widths), (N.lower + N.upper) / 2, (N.upper - N.lower) / 6


def check():
    text = gzip.decompress(FILE.read_bytes()).decode()
    records = dict(re.findall(r"^#(\d+)=(.*?);$", text, flags=re.MULTILINE | re.DOTALL))

    def length(number):
        match = re.search(r"LENGTH_MEASURE\(([-\d.E]+)\)", records[number])
        return float(match.group(1)) if match else np.nan  # an angle

    tolerance = re.compile(r"(?:GEOMETRIC|PERPENDICULARITY|FLATNESS)_TOLERANCE\('[^']*','[^']*',#(\d+),")
    widths = [length(match.group(1)) for record in records.values() if (match := tolerance.search(record))]
    pairs = re.findall(r"TOLERANCE_VALUE\(#(\d+),#(\d+)\)", text)
    limits = [(length(lower), length(upper)) for lower, upper in pairs]
    (limits_of_bore,) = [pair for pair in limits if abs(pair[0] + 0.1) < 1e-9]
    return len(widths), sum(widths), N.nominal + sum(limits_of_bore) / 2, (limits_of_bore[1] - limits_of_bore[0]) / 6


def step_file():
    """Return the path of the STEP file, unpacked into the folder for temporary files."""
    path = Path(tempfile.gettempdir()) / FILE.stem
    if not path.exists():
        path.write_bytes(gzip.decompress(FILE.read_bytes()))
    return path


def assembly():
    model = tc.Assembly("CTC 01")
    part = model.part("part", tc.Mesh(step_file()), fixed=True)
    tc.io.features_from_pmi(part)
    model.measure("place", part.point(0, 0, 0), along="z")
    return model


def answers():
    tolerances = tc.io.read_pmi(step_file()).tolerances
    results = an.simulated(assembly(), 20_000, keep="all")
    deviations = results["sample"].deviation
    (label,) = [name for name in deviations.contributor.values if "cylinder 53" in name and name.endswith("size")]
    size = N.nominal + deviations.sel(contributor=label).values
    widths = [tolerance.value or 0.0 for tolerance in tolerances]
    stated = an.within(len(tolerances), 0), an.within(sum(widths), 1e-9)
    return an.Answers([*stated, an.mean(size), an.deviation(size)], len(size))
