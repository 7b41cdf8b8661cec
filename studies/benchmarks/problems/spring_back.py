"""Two bars that are welded at their ends while they are bent, and released."""

import numpy as np

import tolcontact as tc
from studies.benchmarks import answers as an
from studies.benchmarks.beams import beam_stiffness
from studies.benchmarks.plates import saved_body
from studies.benchmarks.problem import numbers

N = numbers(__file__)
ELEMENTS = 40
AREA, BENDING = N.width * N.h, N.E * N.width * N.h**3 / 12
ENDS, MIDDLE = [(x, y) for x in (0, N.length) for y in (0, N.width)], [(N.length / 2, y) for y in (0, N.width)]


def solution():
    slip = 6 * N.h * N.d / N.length
    weld = slip / (N.h**2 * N.length / 2 / BENDING + 2 * N.length / N.E / AREA)
    return weld * N.h / 2 / BENDING * N.length**2 / 8, weld


def check():
    bent, stretched = beam_stiffness(N.length, ELEMENTS, BENDING), N.E * AREA / N.length * np.array([[1, -1], [-1, 1]])
    size = len(bent) + 2  # heights and slopes, then the displacements of both ends along the bar
    K, ends = np.zeros((2 * size, 2 * size)), (0, 2 * ELEMENTS)
    for bar in (slice(0, size), slice(size, 2 * size)):
        own = np.zeros((size, size))
        own[:-2, :-2], own[-2:, -2:] = bent, stretched
        K[bar, bar] = own

    def row(*entries):
        values = np.zeros(2 * size)
        for place, value in entries:
            values[place] += value
        return values

    def slipped(end):  # the upper bar against the lower one, on their common face
        along, slope = size - 2 + end, ends[end] + 1
        return row((size + along, 1), (along, -1), (size + slope, N.h / 2), (slope, N.h / 2))

    def held(rows, targets):  # least energy
        A = np.array(rows)
        system = np.block([[K, A.T], [A, np.zeros((len(A), len(A)))]])
        both = np.linalg.lstsq(system, np.concatenate([np.zeros(2 * size), targets]), rcond=1e-15)[0]
        return both[: 2 * size], both[2 * size :]

    free = [row((0, 1)), row((2 * ELEMENTS, 1)), row((size - 2, 1))]
    upper = [row((size, 1)), row((size + 2 * ELEMENTS, 1)), row((2 * size - 2, 1))]
    middles = [row((ELEMENTS, 1)), row((size + ELEMENTS, 1))]
    clamped, _ = held([*free, *upper, *middles], np.array([0.0] * 6 + [N.d] * 2))
    welds = [slipped(0), slipped(1), *(row((size + end, 1), (end, -1)) for end in ends)]
    released, forces = held([*free, *welds], np.concatenate([[0.0] * 3, np.array(welds) @ clamped]))
    return released[ELEMENTS], abs(forces[4])


def bar_body(name, above):
    """Return the elasticity of a bar by its welded face, which is `above` its middle (1) or below (-1).

    The middle rises against the ends, and the face stretches. A force in the middle bends it, and so does a force along
    the face, evenly.
    """
    places = np.array([*ENDS, *MIDDLE], dtype=float)
    rise, stretch = np.zeros((2, len(places), 3))
    rise[:, 2] = [-0.25] * 4 + [0.5] * 2
    stretch[:4, 0] = [-0.5, -0.5, 0.5, 0.5]
    cross = above * N.h / 2 * N.length**2 / 8 / BENDING
    along = N.length / N.E / AREA + N.h**2 / 4 * N.length / BENDING
    stiffness = np.linalg.inv([[N.length**3 / 48 / BENDING, cross], [cross, along]])
    z = N.h if above > 0 else 0.0
    nodes = np.column_stack([places, np.full(len(places), z)])
    return saved_body(name, nodes, np.array([rise.ravel(), stretch.ravel()]), stiffness)


def assembly():
    model = tc.Assembly("spring-back", method=tc.Method(objective="seating"))
    weld = model.station("weld")
    schemes = {}
    for name, z, above in (("lower", 0.0, 1), ("upper", N.h, -1)):
        part = model.part(name, tc.Box(N.length, N.width, N.h), at=(0, 0, z))
        part.elastic(**bar_body(name, above))
        face = N.h if above > 0 else 0.0

        def held(label, place, along, lift=0.0, part=part, face=face):
            return tc.Locator(label, part.point(*place, face), along, tc.Tolerance(0.0, shift=lift))

        sides = [held("B0", ENDS[0], "y"), held("B1", ENDS[2], "y"), held("C", ENDS[0], "x")]
        heights = [held(f"A{k}", place, "z") for k, place in enumerate(ENDS[:3])]
        weld.locate(part, [*heights, held("lift", MIDDLE[0], "z", float(N.d)), *sides])
        schemes[part] = [*heights, *sides]
    lower, upper = schemes
    joint = weld.join("bars", lower, upper, at=[lower.point(*place, N.h) for place in ENDS])
    check_station = model.station("check")
    check_station.locate(joint, schemes[lower])
    check_station.measure("middle", lower.point(*MIDDLE[0], N.h), along="z")
    return model


def answers():
    results = an.simulated(assembly(), 2, keep="all")
    pairs = [str(name) for name in results.pair.values]
    contact, loads = results["contact"].to_dataset(), results["elastic"].to_dataset()
    points = loads.point_of_load.values
    is_weld = np.array([pairs[k].startswith("welds of") for k in contact.pair_of_point.values[points]])
    is_along = np.abs(contact.reference_normal.values[points][:, 0]) > 0.5
    height = an.values(results, "middle")[0]
    force = np.abs(loads.reaction_at_load.values[0, is_weld & is_along]).sum() / 2
    return an.Answers([an.within(height, 1e-6 * height), an.within(force, 1e-6 * force)], 2)
