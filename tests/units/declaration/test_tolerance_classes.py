"""Tolerance classes of ISO 286-1: against published limits, the standard's own formulas, and its rule of equivalent fits."""

import math

import pytest

from tolcontact.declaration.written_tolerance import GRADES, LETTERS, TextFault, ToleranceClass, tolerance_class

# Limit deviations [um] of ISO 286-2, as tables of bearings, dowel pins and machine elements print them: lower, upper.
PUBLISHED = {
    "3 H6": (0, 6), "2 H13": (0, 140), "10 H7": (0, 15), "10.1 H7": (0, 18), "25 H8": (0, 33), "50 H7": (0, 25),
    "50 H11": (0, 160), "80 H7": (0, 30), "120 H7": (0, 35), "250 H7": (0, 46), "500 H7": (0, 63), "400 H9": (0, 140),
    "20 A11": (300, 430), "8 B11": (150, 240), "35 C11": (120, 280), "25 D10": (65, 149), "25 E9": (40, 92),
    "25 F7": (20, 41), "25 F8": (20, 53), "12 G6": (6, 17), "50 G7": (9, 34), "100 G7": (12, 47), "30 J7": (-9, 12),
    "100 J7": (-13, 22), "47 J6": (-6, 10), "8 J8": (-10, 12), "30 JS7": (-10.5, 10.5), "10 JS6": (-4.5, 4.5),
    "47 K6": (-13, 3), "10 K7": (-10, 5), "35 K7": (-18, 7), "100 K7": (-25, 10), "20 K8": (-23, 10), "2 K9": (-25, 0),
    "20 M6": (-17, -4), "50 M7": (-25, 0), "10 M7": (-15, 0), "300 M6": (-41, -9), "300 M7": (-52, 0), "250 M6": (-37, -8),
    "50 N7": (-33, -8), "100 N7": (-45, -10), "20 N9": (-52, 0), "2 N9": (-29, -4), "6 N9": (-30, 0), "15 N6": (-20, -9),
    "10 P9": (-51, -15), "50 P7": (-42, -17), "100 P7": (-59, -24), "47 P6": (-37, -21), "2 P7": (-16, -6),
    "6 P7": (-20, -8), "28 R7": (-41, -20), "50 R7": (-50, -25), "100 R7": (-73, -38), "2 R7": (-20, -10),
    "20 S7": (-48, -27), "60 S7": (-72, -42), "50 T7": (-70, -45), "50 U7": (-86, -61), "20 U8": (-74, -41),
    "50 X8": (-136, -97), "12 Z8": (-77, -50), "50 a11": (-480, -320), "50 b11": (-340, -180), "20 c11": (-240, -110),
    "50 d9": (-142, -80), "20 d10": (-149, -65), "50 e8": (-89, -50), "20 e7": (-61, -40), "50 f7": (-50, -25),
    "20 f6": (-33, -20), "25 f8": (-53, -20), "50 g6": (-25, -9), "25 g6": (-20, -7), "10 g5": (-11, -5),
    "100 g6": (-34, -12), "6 cd8": (-64, -46), "8 ef7": (-33, -18), "3 fg6": (-10, -4), "50 h6": (-16, 0),
    "10 h9": (-36, 0), "20 h11": (-130, 0), "8 h8": (-22, 0), "250 h5": (-20, 0), "20 js6": (-6.5, 6.5),
    "10 js9": (-18, 18), "50 j6": (-5, 11), "50 j5": (-5, 6), "20 j7": (-8, 13), "30 j6": (-4, 9), "2 j8": (-6, 8),
    "50 k6": (2, 18), "10 k6": (1, 10), "3 k6": (0, 6), "100 k5": (3, 18), "20 k8": (0, 33), "20 k3": (0, 4),
    "6 m6": (4, 12), "10 m6": (6, 15), "50 m6": (9, 25), "20 m5": (8, 17), "50 n6": (17, 33), "25 n5": (15, 24),
    "20 p6": (22, 35), "50 p6": (26, 42), "100 p6": (37, 59), "50 r6": (34, 50), "70 r6": (43, 62), "25 s6": (35, 48),
    "50 s6": (43, 59), "75 s6": (59, 78), "50 t6": (54, 70), "25 t6": (41, 54), "50 u6": (70, 86), "25 u6": (48, 61),
    "30 v6": (55, 68), "50 x6": (97, 113), "20 y6": (63, 76), "15 z6": (60, 71), "12 za7": (64, 82), "50 zb8": (242, 281),
    "100 zc9": (585, 672), "600 H7": (0, 70), "1000 H8": (0, 140), "3150 H6": (0, 135), "800 g6": (-74, -24),
    "600 F8": (76, 186), "900 js7": (-45, 45), "600 N7": (-114, -44), "700 P7": (-168, -88), "1200 m6": (40, 106),
    "2000 d9": (-800, -430),
}  # fmt: skip


def test_limits_are_those_that_tables_print():
    found = {}
    for designation in PUBLISHED:
        nominal, text = designation.split()
        found[designation] = tolerance_class(text).deviations(float(nominal))
    assert found == {designation: (lower / 1000, upper / 1000) for designation, (lower, upper) in PUBLISHED.items()}


@pytest.mark.parametrize("letter", LETTERS[LETTERS.index("k") :])
def test_a_hole_makes_the_fit_that_the_shaft_of_its_letter_makes(letter):
    """ISO 286-1: H7/p6 and P7/h6, with the hole one grade coarser than the shaft, have the same clearances."""
    coarsest = 8 if letter in "kmn" else 7
    compared = 0
    for nominal in (4, 8, 12, 16, 20, 27, 35, 45, 60, 70, 90, 110, 130, 150, 170, 190, 210, 240, 320, 380, 420, 480):
        for grade in range(5 if letter == "k" else 3, coarsest + 1):
            hole, shaft = ToleranceClass(letter.upper(), str(grade)), ToleranceClass(letter, str(grade - 1))
            try:
                own, mirrored = hole.deviations(nominal), shaft.deviations(nominal)
            except TextFault:
                continue
            basic_hole = ToleranceClass("H", str(grade)).deviations(nominal)
            basic_shaft = ToleranceClass("h", str(grade - 1)).deviations(nominal)
            assert own[0] - basic_shaft[1] == pytest.approx(basic_hole[0] - mirrored[1], abs=1e-9)
            assert own[1] - basic_shaft[0] == pytest.approx(basic_hole[1] - mirrored[0], abs=1e-9)
            compared += 1
    assert compared > 60


def geometric_mean(nominal, steps):
    upper = next(step for step in steps if nominal <= step)
    return math.sqrt(upper * steps[steps.index(upper) - 1])


STEPS = [3, 6, 10, 18, 30, 50, 80, 120, 180, 250, 315, 400, 500, 630, 800, 1000, 1250, 1600, 2000, 2500, 3150]
UNITS = {5: 7, 6: 10, 7: 16, 8: 25, 9: 40, 10: 64, 11: 100, 12: 160, 13: 250, 14: 400, 15: 640, 16: 1000, 17: 1600, 18: 2500}


@pytest.mark.parametrize("grade", UNITS)
def test_widths_follow_the_unit_of_the_standard(grade):
    """ISO 286-1, annex: i = 0.45 D^(1/3) + 0.001 D up to 500 mm, I = 0.004 D + 2.1 above; rounded, to 10 % where i is small."""
    for nominal in STEPS[1:]:
        mean = geometric_mean(nominal, STEPS)
        unit = 0.45 * mean ** (1 / 3) + 0.001 * mean if nominal <= 500 else 0.004 * mean + 2.1
        lower, upper = ToleranceClass("H", str(grade)).deviations(nominal)
        assert lower == 0
        assert 1000 * upper == pytest.approx(UNITS[grade] * unit, rel=0.1 if grade < 8 else 0.06)


FORMULAS = {  # of ISO 286-1, annex: the distance of the zone from the nominal size [um], by the geometric mean D [mm] of a step
    "d": lambda mean: 16 * mean**0.44,
    "e": lambda mean: 11 * mean**0.41,
    "f": lambda mean: 5.5 * mean**0.41,
    "m": lambda mean: 0.024 * mean + 12.6,
    "n": lambda mean: 0.04 * mean + 21,
    "p": lambda mean: 0.072 * mean + 37.8,
}


@pytest.mark.parametrize("letter", FORMULAS)
def test_zones_above_500_mm_lie_where_the_formulas_say(letter):
    for nominal in STEPS[13:]:
        lower, upper = ToleranceClass(letter, "7").deviations(nominal)
        distance = 1000 * min(abs(lower), abs(upper))
        assert distance == pytest.approx(FORMULAS[letter](geometric_mean(nominal, STEPS)), rel=0.05)


@pytest.mark.parametrize("letters", [case(letter) for letter in LETTERS for case in (str.lower, str.upper)])
def test_zones_have_the_width_of_their_grade_and_grow_with_it(letters):
    for nominal in (0.8, 2, 7, 40, 260, 480, 900, 3000):
        previous = 0.0
        for grade in GRADES:
            try:
                lower, upper = ToleranceClass(letters, grade).deviations(nominal)
            except TextFault:
                continue
            width = ToleranceClass("H", grade).deviations(nominal)[1]
            assert upper - lower == pytest.approx(width, abs=1e-9)
            assert width > previous
            previous = width


UNDEFINED = {
    "10 H19": "has no grade 19", "10 i7": 'has no letters "i"', "10 Js7": 'write "JS7" for a hole, "js7" for a shaft',
    "3151 H7": "for sizes above 0, up to 3150 mm", "0 H7": "for sizes above 0", "-5 h6": "for sizes above 0",
    "600 H01": "up to 500 mm", "600 x6": "up to 500 mm", "20 t6": "for sizes above 24 mm, up to 3150 mm",
    "10 v6": "for sizes above 14 mm, up to 500 mm", "12 j8": "up to 3 mm", "10 j9": "j has the grades 5 to 8",
    "10 J5": "J the grades 6 to 8", "0.9 a9": "it has a for sizes above 1 mm", "1 H14": "above 1 mm", "60 ef7": "up to 50 mm",
    "10 K9": "K above grade 8 for sizes up to 3 mm alone", "0.5 N9": "above 1 mm", "20 P2": "from grade 3",
    "600 K9": "K above grade 8 for sizes up to 3 mm alone",
}  # fmt: skip


@pytest.mark.parametrize("designation", UNDEFINED)
def test_what_the_standard_does_not_define_is_refused(designation):
    nominal, text = designation.split()
    with pytest.raises(TextFault) as refusal:
        tolerance_class(text).deviations(float(nominal))
    assert UNDEFINED[designation] in str(refusal.value)


@pytest.mark.parametrize("text", ["H", "7", "+0.1", "H7/g6", "H 07", "10 H7", "HHH7", "H7.5", "", "h100"])
def test_other_texts_are_no_classes(text):
    assert tolerance_class(text) is None
