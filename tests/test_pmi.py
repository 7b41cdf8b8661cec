"""Tolerances, dimensions and datums in the text of STEP files."""

import csv
import io
import json
import random
import time

import pytest

import tolcontact as tc
from tests.helpers import call
from tolcontact.errors import OptionError

AP242 = "AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 %d 1 4 }"
MM = "#1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));"
INCH = "#2=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(25.4),#1); #3=(CONVERSION_BASED_UNIT('INCH',#2)LENGTH_UNIT()NAMED_UNIT(#4));"
DEGREE = (
    "#5=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));"
    "#6=PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE(0.0174532925),#5);"
    "#7=(CONVERSION_BASED_UNIT('DEGREE',#6)NAMED_UNIT(#4)PLANE_ANGLE_UNIT());"
)
FACES = "".join(f"#{k}=ADVANCED_FACE('',(),#9,.T.);" for k in range(11, 16))
A = "SHAPE_ASPECT('','',#10,.T.)"


def step(*data, schema=AP242 % 1):
    return (
        f"ISO-10303-21;\nHEADER;\nFILE_SCHEMA(('{schema}'));\nENDSEC;\nDATA;\n{MM}\n{INCH}\n{DEGREE}\n{FACES}\n"
        + "\n".join(data)
        + "\nENDSEC;\nEND-ISO-10303-21;\n"
    )


def usage(number, aspect, *faces):
    items = f"#{faces[0]}" if len(faces) == 1 else f"SET_REPRESENTATION_ITEM(({','.join(f'#{face}' for face in faces)}))"
    kind = "GEOMETRIC_ITEM_SPECIFIC_USAGE" if len(faces) == 1 else "ITEM_IDENTIFIED_REPRESENTATION_USAGE"
    return f"#{number}={kind}('',$,#{aspect},#8,{items});"


def mm(number, value, unit=1):
    return f"#{number}=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({value}),#{unit});"


POSITION = (
    mm(20, 0.25), f"#21={A};", usage(22, 21, 11),
    "#23=(GEOMETRIC_TOLERANCE('hole','',#20,#21)GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE((#24))"
    "GEOMETRIC_TOLERANCE_WITH_MODIFIERS((.MAXIMUM_MATERIAL_REQUIREMENT.,.FREE_STATE.))POSITION_TOLERANCE());",
    "#24=DATUM_SYSTEM('',$,#10,.F.,(#25,#26,#27));",
    "#25=DATUM_REFERENCE_COMPARTMENT('',$,#10,.F.,#31,$);",
    "#26=DATUM_REFERENCE_COMPARTMENT('',$,#10,.F.,#32,(SIMPLE_DATUM_REFERENCE_MODIFIER(.MAXIMUM_MATERIAL_REQUIREMENT.)));",
    "#27=DATUM_REFERENCE_COMPARTMENT('',$,#10,.F.,COMMON_DATUM_LIST((#28,#29)),$);",
    "#28=DATUM_REFERENCE_ELEMENT('',$,#10,.F.,#33,$); #29=DATUM_REFERENCE_ELEMENT('',$,#10,.F.,#34,$);",
    "#31=DATUM('',$,#10,.F.,'A'); #32=DATUM('',$,#10,.F.,'B'); #33=DATUM('',$,#10,.F.,'C'); #34=DATUM('',$,#10,.F.,'D');",
    "#41=DATUM_FEATURE('','',#10,.T.); #42=SHAPE_ASPECT_RELATIONSHIP('',$,#41,#31);", usage(43, 41, 12),
    "#44=PLACED_DATUM_TARGET_FEATURE('','point',#10,.T.,'1'); #45=SHAPE_ASPECT_RELATIONSHIP('',$,#44,#32);",
    f"#46={A}; #47=FEATURE_FOR_DATUM_TARGET_RELATIONSHIP('',$,#46,#44);", usage(48, 46, 13),
    "#50=TOLERANCE_ZONE('',$,#10,.F.,(#23),#51); #51=TOLERANCE_ZONE_FORM('cylindrical or circular');",
    "#52=PROJECTED_ZONE_DEFINITION(#50,(),#10,#53);", mm(53, "1.0", 3),
)  # fmt: skip


@pytest.fixture
def read(tmp_path):
    def function(*data, schema=AP242 % 1):
        path = tmp_path / "part.stp"
        path.write_text(data[0] if data[0].startswith("ISO") else step(*data, schema=schema))
        return tc.io.read_pmi(path)

    return function


def test_a_position_has_its_zone_its_modifiers_and_its_datum_system(read):
    pmi = read(*POSITION)
    (position,) = pmi.tolerances
    assert (position.kind, position.name, position.value, position.face_records) == ("position", "hole", 0.25, (11,))
    assert position.zone == "cylindrical or circular" and position.projected == pytest.approx(25.4)
    assert position.modifiers == ("maximum material requirement", "free state")
    assert position.datum_system == "A | B (M) | C-D" and position.details == "diameter, projected 25.4, M, F"
    first, second, *_ = pmi.datums
    assert (first.letter, first.face_records, first.targets) == ("A", (12,), ())
    (target,) = second.targets
    assert (str(target), target.face_records, second.face_records) == ("B1 point", (13,), (13,))
    assert str(position) == "1. position 0.25 mm (diameter, projected 25.4, M, F), datums A | B (M) | C-D, 1 faces"


def test_a_flatness_per_unit_and_an_unequal_profile_all_around(read):
    pmi = read(
        mm(20, 0.005, 3), mm(21, 1, 3), mm(22, 2, 3), f"#23={A};", usage(24, 23, 11, 12),
        "#25=(FLATNESS_TOLERANCE()GEOMETRIC_TOLERANCE('','',#20,#23)GEOMETRIC_TOLERANCE_WITH_DEFINED_AREA_UNIT(.RECTANGULAR.,#22)"
        "GEOMETRIC_TOLERANCE_WITH_DEFINED_UNIT(#21));",
        "#26=ALL_AROUND_SHAPE_ASPECT('','',#10,.T.); #27=SHAPE_ASPECT_RELATIONSHIP('','',#26,#23);",
        "#28=(GEOMETRIC_TOLERANCE('','',#21,#26)SURFACE_PROFILE_TOLERANCE()UNEQUALLY_DISPOSED_GEOMETRIC_TOLERANCE(#20));",
        "#29=PARALLELISM_TOLERANCE('','',#20,#30); #30=PRODUCT_DEFINITION_SHAPE('','',#10);",
    )  # fmt: skip
    flatness, profile, parallelism = pmi.tolerances
    assert flatness.value == pytest.approx(0.127) and flatness.per_unit == pytest.approx((25.4, 50.8))
    assert flatness.details == "per 25.4 x 50.8 rectangular" and flatness.face_records == (11, 12)
    assert (profile.kind, profile.extent, profile.face_records) == ("surface profile", "all around", (11, 12))
    assert profile.displacement == pytest.approx(0.127)
    assert (parallelism.extent, parallelism.face_records) == ("all over", (11, 12, 13, 14, 15))


def test_a_composite_frame_over_a_pattern_of_derived_features(read):
    pmi = read(
        mm(20, 1), mm(21, 0.2),
        f"#22=COMPOSITE_GROUP_SHAPE_ASPECT('','',#10,.T.); #23={A}; #24=CENTRE_OF_SYMMETRY('','',#10,.F.); #25={A};",
        "#26=SHAPE_ASPECT_RELATIONSHIP('','',#22,#23); #27=SHAPE_ASPECT_RELATIONSHIP('','',#22,#24);",
        "#28=SHAPE_ASPECT_DERIVING_RELATIONSHIP('','',#24,#25);", usage(29, 23, 11), usage(30, 25, 12, 13), usage(31, 25, 40),
        "#32=POSITION_TOLERANCE('','',#20,#22); #33=POSITION_TOLERANCE('','',#21,#22);",
        "#34=GEOMETRIC_TOLERANCE_RELATIONSHIP('composite','',#32,#33); #40=GEOMETRIC_CURVE_SET('',(#41,#42));",
    )  # fmt: skip
    upper, lower = pmi.tolerances
    assert upper.refines is None and lower.refines == 1 and lower.details == "refines 1"
    assert upper.face_records == lower.face_records == (11, 12, 13) and lower.other_records == (41, 42)


def item(number, value, name="", qualifiers="", unit=3, kind="LENGTH"):
    qualified = f"QUALIFIED_REPRESENTATION_ITEM((#{qualifiers}))" if qualifiers else ""
    return (
        f"#{number}=({kind}_MEASURE_WITH_UNIT()MEASURE_REPRESENTATION_ITEM()MEASURE_WITH_UNIT({kind}_MEASURE({value}),#{unit})"
        f"{qualified}REPRESENTATION_ITEM('{name}'));"
    )


def values(number, dimension, *items):
    return (
        f"#{number}=DIMENSIONAL_CHARACTERISTIC_REPRESENTATION(#{dimension},#{number + 1});"
        f"#{number + 1}=SHAPE_DIMENSION_REPRESENTATION('',({','.join(f'#{k}' for k in items)}),#8);"
    )


def test_sizes_in_inch_have_limits_in_mm(read):
    pmi = read(
        f"#20={A};", usage(21, 20, 11), "#22=DIMENSIONAL_SIZE(#20,'diameter'); #23=DIMENSIONAL_SIZE(#20,'radius');",
        item(30, 0.5, "nominal value"), item(31, 0.49, "lower limit"), item(32, 0.52, "upper limit"),
        values(33, 22, 30, 31, 32),
        item(40, 0.1, "", 43), "#41=DESCRIPTIVE_REPRESENTATION_ITEM('dimensional note','controlled radius');",
        "#42=COMPOUND_REPRESENTATION_ITEM('',SET_REPRESENTATION_ITEM((#41,#42))); #43=TYPE_QUALIFIER('maximum');",
        values(44, 23, 40, 42),
        "#50=DIMENSIONAL_SIZE_WITH_DATUM_FEATURE('','',#10,.T.,#50,'diameter');", usage(51, 50, 12),
        item(52, 1), values(53, 50, 52),
        "#55=PLUS_MINUS_TOLERANCE(#56,#50); #56=TOLERANCE_VALUE(#57,#58);", mm(57, -0.1), mm(58, 0.2),
        "#60=DIMENSIONAL_SIZE(#20,'diameter'); #61=PLUS_MINUS_TOLERANCE(#62,#60); #62=LIMITS_AND_FITS('H7','hole','','');",
        "#63=DIMENSIONAL_SIZE(#20,'diameter'); #64=PLUS_MINUS_TOLERANCE(#65,#63); #65=LIMITS_AND_FITS('H','hole','7','');",
        "#66=DIMENSIONAL_SIZE(#20,'diameter'); #67=PLUS_MINUS_TOLERANCE(#68,#66); #68=LIMITS_AND_FITS('g','','6','');",
    )  # fmt: skip
    size, radius, datum, fit, *fits = pmi.dimensions
    assert (size.kind, size.name, size.unit, size.face_records) == ("size", "diameter", "mm", (11,))
    assert (size.nominal, size.lower, size.upper) == pytest.approx((12.7, 12.446, 13.208))
    assert radius.nominal == pytest.approx(2.54) and radius.modifiers == ("maximum", "controlled radius")
    assert (datum.name, datum.face_records) == ("diameter", (12,))
    assert (datum.lower, datum.upper) == pytest.approx((25.3, 25.6))
    assert (fit.nominal, fit.lower, fit.fit, fit.unit) == (None, None, "H7 hole", "")
    assert [dimension.fit for dimension in fits] == ["H7 hole", "g6"]


def test_locations_have_two_ends_and_angles_are_in_rad(read):
    pmi = read(
        f"#20={A}; #21={A};", usage(22, 20, 11), usage(23, 21, 12, 13),
        "#24=DIMENSIONAL_LOCATION('linear distance',$,#20,#21); #25=ANGULAR_LOCATION('angle',$,#21,#20,.EQUAL.);",
        item(26, 30, unit=7, kind="PLANE_ANGLE"), values(27, 25, 26), "#30=ANGULAR_SIZE(#20,'angle',.EQUAL.);",
        "#31=POSITION_TOLERANCE('','',$,#24);",
    )  # fmt: skip
    distance, angle, size = pmi.dimensions
    assert (distance.kind, distance.face_records, distance.end_face_records) == ("location", (11,), (12, 13))
    assert (angle.kind, angle.unit) == ("angular location", "rad") and angle.nominal == pytest.approx(0.5235987756)
    assert (size.kind, size.name, size.nominal) == ("angular size", "angle", None)
    (position,) = pmi.tolerances
    assert position.value is None and position.face_records == (11, 12, 13)


def test_references_without_a_datum_system_are_in_order_of_precedence(read):
    pmi = read(
        "#20=DATUM('',$,#10,.F.,'A'); #21=DATUM('',$,#10,.F.,'B'); #22=DATUM_REFERENCE(2,#20); #23=DATUM_REFERENCE(1,#21);",
        mm(25, 1), "#24=ANGULARITY_TOLERANCE('','',#25,#26,(#22,#23));",
        "#31=DATUM_SYSTEM('',$,#10,.F.,(#32));", "#33=DATUM_REFERENCE_MODIFIER_WITH_VALUE(.CIRCULAR_OR_CYLINDRICAL.,#25);",
        "#32=DATUM_REFERENCE_COMPARTMENT('',$,#10,.F.,#20,(#33,SIMPLE_DATUM_REFERENCE_MODIFIER"
        "(.TRANSLATION.)));", "#34=SYMMETRY_TOLERANCE('','',#25,#26,(#31));",
    )  # fmt: skip
    angularity, symmetry = pmi.tolerances
    assert angularity.datum_system == "B | A"
    assert symmetry.datum_system == "A (circular or cylindrical 1) (▷)"


@pytest.mark.parametrize("version, edition", [(1, 1), (2, 2), (3, 2), (4, 3)])
def test_editions_are_known_by_the_object_identifier(version, edition, read):
    assert read("", schema=AP242 % version).edition == edition


def test_an_edition_that_is_not_stated_is_read(read):
    pmi = read(*POSITION, schema="AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF")
    assert pmi.edition is None and len(pmi.tolerances) == 1
    assert str(pmi) == "AP242: 1 tolerances, 0 dimensions, 4 datums"


def test_later_editions_and_other_files_are_refused_by_name(read, tmp_path):
    with pytest.raises(OptionError, match=r"AP242 edition 4 or later .* is not read"):
        read("", schema=AP242 % 5)
    for name, content, words in (
        ("a.qif", b'<?xml version="1.0"?><QIFDocument>', "is a QIF document, which is not read"),
        ("a.stpx", b'<?xml version="1.0"?>', "is an XML document"),
        ("a.stpz", b"PK\x03\x04", "is a compressed file"),
        ("a.stp", b"solid", "does not begin with ISO-10303-21"),
        ("b.stp", b"", "is empty"),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(OptionError, match=words):
            tc.io.read_pmi(tmp_path / name)
    for path in (tmp_path, tmp_path / "nowhere.stp", "a\0b", "/dev/zero"):
        with pytest.raises(OptionError, match=r"does not exist|is a folder|cannot be opened"):
            tc.io.read_pmi(path)


HOSTILE = {
    "an unclosed string": (step("#20=FLATNESS_TOLERANCE('x,'',#21,#22);"), "is cut off, or a text in it is not closed"),
    "a file that is cut off": (step(*POSITION)[:-30], "is cut off"),
    "an unclosed comment": (step("/* #20=DATUM();"), "is cut off"),
    "lists in lists": (step(f"#20=FLATNESS_TOLERANCE({'(' * 100_000}{')' * 100_000});"), "record #20 is damaged, or has lists"),
    "an unclosed list": (step("#20=FLATNESS_TOLERANCE('',(#1;"), "record #20 is damaged"),
    "characters that mean nothing": (step("#20=FLATNESS_TOLERANCE('',?);"), "record #20 is damaged"),
    "a value that is not a number": (step("#20=FLATNESS_TOLERANCE('','',#21,$); #21=LENGTH_MEASURE_WITH_UNIT(NaN,#1);"), "#21"),
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_damaged_file_leads_to_one_message(kind, read):
    content, words = HOSTILE[kind]
    with pytest.raises(OptionError) as refused:
        read(content)
    message = str(refused.value)
    assert words in message and len(message) < 400 and "\n" not in message


def test_circles_end(read):
    pmi = read(
        mm(20, "1.E400"),
        f"#21={A}; #22=SHAPE_ASPECT_RELATIONSHIP('','',#21,#21); #23=SHAPE_ASPECT_RELATIONSHIP('','',#21,#24);",
        f"#24={A}; #25=SHAPE_ASPECT_RELATIONSHIP('','',#24,#21);", usage(26, 24, 30), "#27=FLATNESS_TOLERANCE('','',#20,#21);",
        "#30=CLOSED_SHELL('',(#30,#11)); #31=DIMENSIONAL_SIZE(#31,''); #32=DIMENSIONAL_LOCATION('','',#32,#32);",
        "#33=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(1.),#34); #34=(CONVERSION_BASED_UNIT('',#33)LENGTH_UNIT());",
        "#35=FLATNESS_TOLERANCE('','',#33,#99999); #36=GEOMETRIC_TOLERANCE_RELATIONSHIP('','',#35,#35);",
    )  # fmt: skip
    first, second = pmi.tolerances
    assert (first.value, first.face_records) == (None, (11,))
    assert (second.value, second.face_records, second.refines) == (None, (), 2)
    assert len(pmi.dimensions) == 2


def test_a_few_hundred_thousand_records_take_seconds(read):
    count = 300_000
    points = [f"#{100 + k}=CARTESIAN_POINT('',(0.,{k}.,1.E-3));" for k in range(count)]
    flatness = [f"#{100 + count + k}=FLATNESS_TOLERANCE('','',#20,#21);" for k in range(5000)]
    start = time.process_time()
    pmi = read(mm(20, 1), f"#21={A};", usage(22, 21, 11), *points, *flatness)
    assert len(pmi.tolerances) == 5000 and time.process_time() - start < 20


@pytest.mark.nightly
def test_tolerances_that_all_refer_to_all_faces_are_refused(read):
    faces = ",".join(f"#{k}" for k in range(1000, 11_000))
    with pytest.raises(OptionError, match="refer to more than 2000000 faces"):
        read(
            f"#20=CLOSED_SHELL('',({faces}));",
            *(f"#{k}=FLATNESS_TOLERANCE('','',$,#{k + 1}); #{k + 1}={A};" for k in range(50_000, 51_500, 3)),
            *(usage(k + 2, k + 1, 20) for k in range(50_000, 51_500, 3)),
        )


def test_a_damaged_text_is_read_or_refused(read):
    chosen = random.Random(1)
    pieces = ["", "'", "(", ")", ",", "#", "$", ";", "#23", ".", "1", "*/", "/*"]
    content = step(*POSITION)
    accepted = 0
    for _ in range(400):
        damaged = list(content)
        for _ in range(chosen.randint(1, 4)):
            at = chosen.randrange(60, len(damaged))
            damaged[at : at + chosen.randint(0, 3)] = chosen.choice(pieces)
        try:
            read("".join(damaged))
            accepted += 1
        except OptionError as error:
            assert len(str(error)) < 400
    assert accepted


def test_texts_of_a_file_are_decoded_and_comments_are_left_out(read):
    text = r"#20=FLATNESS_TOLERANCE('it''s; \X2\00D8\X0\ /* no comment */','',$,$); /* #30=FLATNESS_TOLERANCE('','',$,$); ' */"
    (flatness,) = read(text).tolerances
    assert flatness.name == "it's; Ø /* no comment */"


def test_the_command_prints_tables_in_80_columns(tmp_path):
    path = tmp_path / "part.stp"
    path.write_text(step(*POSITION, f"#60={A};", "#61=DIMENSIONAL_SIZE(#60,'diameter');", item(62, 0.5), values(63, 61, 62)))
    done = call(tmp_path, "pmi", path.name)
    assert done.returncode == 0, done.stderr
    assert max(map(len, done.stdout.splitlines())) <= 80
    for words in ("AP242 edition 1: 1 tolerances, 1 dimensions, 4 datums", "position", "A | B (M)", "12.7", "B1 point"):
        assert words in done.stdout
    data = json.loads(call(tmp_path, "pmi", path.name, "--json").stdout)
    assert data["tolerances"][0]["face_records"] == [11] and data["edition"] == 1
    tolerance, dimension = csv.DictReader(io.StringIO(call(tmp_path, "pmi", path.name, "--csv").stdout))
    assert (tolerance["kind"], tolerance["value"], tolerance["datums"]) == ("position", "0.25", "A | B (M) | C-D")
    assert (dimension["type"], dimension["value"], dimension["unit"]) == ("dimension", "12.7", "mm")
    done = call(tmp_path, "pmi", path.name, "--json", "--csv")
    assert done.returncode == 2 and "exclude each other" in done.stderr


@pytest.mark.parametrize(
    "content, words",
    [
        (step(""), "states no tolerances, dimensions or datums"),
        (step("", schema="AUTOMOTIVE_DESIGN"), "is not an AP242 file (its schema is AUTOMOTIVE_DESIGN)"),
        (step("#20=DRAUGHTING_ANNOTATION_OCCURRENCE('',(),#21);"), "its 1 annotations are only drawn"),
        (step("#20=TESSELLATED_SOLID('',(),$);").replace("ADVANCED_FACE", "X"), "its shapes are triangles"),
    ],
)
def test_a_file_that_states_nothing_is_told_in_a_sentence(content, words, tmp_path):
    (tmp_path / "part.stp").write_text(content)
    done = call(tmp_path, "pmi", "part.stp")
    assert done.returncode == 0 and words in done.stdout and done.stdout.count("\n") == 1
    assert call(tmp_path, "pmi", "part.stp", "--csv").stdout.count("\n") == 1
