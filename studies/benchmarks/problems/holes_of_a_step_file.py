"""The distance of two holes whose axes come from a STEP file."""

import re

import numpy as np
from scipy import stats

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.problem import FOLDER, numbers

N = numbers(__file__)
FILE = FOLDER.parents[2] / "models" / "housing.step"
SIGMA = np.sqrt(2) * N.t / 2 / np.sqrt(-2 * np.log(0.0027))  # of each component of the vector between the axes


def solution():
    nominal = np.hypot(N.x2 - N.x1, N.y2 - N.y1)
    distance = stats.rice(nominal / SIGMA, scale=SIGMA)
    # Moments by the series for a large ratio: those of scipy cancel.
    q = (SIGMA / nominal) ** 2
    mean = nominal * (1 + q / 2 + q**2 / 8)
    square = nominal**2 * (1 + 2 * q)
    return nominal, mean, np.sqrt(square - mean**2), distance.cdf(nominal - N.limit) + distance.sf(nominal + N.limit)


def check():
    text = FILE.read_text(encoding="utf-8")
    records = dict(re.findall(r"#(\d+) = (.*?);\n", text, flags=re.DOTALL))
    places = set()
    for axis in re.findall(rf"CYLINDRICAL_SURFACE\('',#(\d+),{N.diameter / 2:g}\.\)", text):
        (point,) = re.findall(r"AXIS2_PLACEMENT_3D\('',#(\d+),", records[axis])
        x, y, _ = records[point].removeprefix("CARTESIAN_POINT('',(").split(",")
        places.add((float(x), float(y)))
    start, end = sorted(places)
    nominal = np.hypot(end[0] - start[0], end[1] - start[1])
    scale = N.t / 2 / np.sqrt(stats.chi2.isf(0.0027, 2)) * np.sqrt(2)
    along, step = np.linspace(-9, 9, 2001, retstep=True)
    across, weights = np.polynomial.hermite_e.hermegauss(12)
    mass = stats.norm.pdf(along)[:, None] * step * weights / weights.sum()
    change = np.hypot(nominal + scale * along[:, None], scale * across) - nominal
    mean = (mass * change).sum()
    deviation = np.sqrt((mass * (change - mean) ** 2).sum())
    # For a given component across, the distance is within the limits where that along is within two bounds.
    bounds = [np.sqrt((nominal + sign * N.limit) ** 2 - (scale * across) ** 2) - nominal for sign in (-1, 1)]
    inside = (weights / weights.sum()) @ (stats.norm.cdf(bounds[1] / scale) - stats.norm.cdf(bounds[0] / scale))
    return nominal, nominal + mean, deviation, 1 - inside


def assembly():
    model = tc.Assembly("holes of a STEP file")
    housing = model.part("housing", tc.Mesh(FILE), fixed=True)
    for letter, direction, corner in (("A", "-z", (113, 73, 0.1)), ("B", "-y", (113, 0.1, 40)), ("C", "-x", (0.1, 73, 40))):
        low = [-0.1 if high == 0.1 else 0.0 for high in corner]
        housing.feature(letter, housing.face(direction, tc.select.Inside(low, corner)), datum=letter)
    faces = []
    for k, (x, y) in enumerate(((N.x1, N.y1), (N.x2, N.y2))):
        walls = tc.select.Cylinder(radius=N.diameter / 2, inner=True), tc.select.Inside((x - 5, y - 5, 0), (x + 5, y + 5, 50))
        faces.append(housing.face(*walls))
        housing.feature(f"hole {k}", faces[k], tc.Position(N.t, "A|B|C", rule="translation"))
    model.measure("distance", tc.AxisDistance(faces[0], faces[1], across=(0, 0, 1)))
    return model


def answers():
    results = an.simulated(assembly(), 200_000)
    distance = an.values(results, "distance")
    nominal = float(tc.summarize(results).measure_nominal.sel(measure="distance"))
    beyond = an.share(abs(distance - nominal) > N.limit)
    return an.Answers([an.within(nominal, 1e-6), an.mean(distance), an.deviation(distance), beyond], len(distance))
