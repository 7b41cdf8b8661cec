"""The kernel's reading of tolerances and dimensions beside the walk of the text."""

import re
from dataclasses import replace

import pytest

import tolcontact as tc
from tests.kernel_annotations import KernelItems, kernel_annotations
from tests.second_reading import compare, second_reading
from tests.test_cad import COVER
from tests.test_pmi import AP242, step
from tolcontact.errors import GeometryFault

ASPECT = "SHAPE_ASPECT('','',#4,.T.)"
DEGREE = (
    "#90002=(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.));"
    "#90003=PLANE_ANGLE_MEASURE_WITH_UNIT(PLANE_ANGLE_MEASURE(0.0174532925199433),#90002);"
    "#90004=(CONVERSION_BASED_UNIT('DEGREE',#90003)NAMED_UNIT(#90005)PLANE_ANGLE_UNIT());"
    "#90005=DIMENSIONAL_EXPONENTS(0.,0.,0.,0.,0.,0.,0.);"
)


def usage(number, aspect, face):
    """Aspect `aspect` has a face, which is the one of this place in the shell."""
    return f"#{number}=GEOMETRIC_ITEM_SPECIFIC_USAGE('','',#{aspect},#10,@{face});"


def mm(number, value):
    return f"#{number}=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE({value}),@mm);"


def item(number, value, name, kind="LENGTH", unit="@mm"):
    return (
        f"#{number}=({kind}_MEASURE_WITH_UNIT()MEASURE_REPRESENTATION_ITEM()MEASURE_WITH_UNIT({kind}_MEASURE({value}),{unit})"
        f"REPRESENTATION_ITEM('{name}'));"
    )


def values(number, dimension, *items):
    listed = ",".join(f"#{one}" for one in items)
    return (
        f"#{number}=DIMENSIONAL_CHARACTERISTIC_REPRESENTATION(#{dimension},#{number + 1});"
        f"#{number + 1}=SHAPE_DIMENSION_REPRESENTATION('',({listed}),#1101);"
    )


def deviations(number, dimension, lower, upper, kind="LENGTH", unit="@mm"):
    return (
        f"#{number}=PLUS_MINUS_TOLERANCE(#{number + 1},#{dimension});"
        f"#{number + 1}=TOLERANCE_VALUE(#{number + 2},#{number + 3});"
        f"#{number + 2}={kind}_MEASURE_WITH_UNIT({kind}_MEASURE({lower}),{unit});"
        f"#{number + 3}={kind}_MEASURE_WITH_UNIT({kind}_MEASURE({upper}),{unit});"
    )


# Numbers of tolerances and dimensions follow their records.
DATA = (
    mm(90010, 0.05), f"#90011={ASPECT};", usage(90012, 90011, 1), "#90013=FLATNESS_TOLERANCE('it''s','',#90010,#90011);",
    mm(90020, 0.25), f"#90021={ASPECT};", usage(90022, 90021, 2),
    "#90023=(GEOMETRIC_TOLERANCE('hole','',#90020,#90021)GEOMETRIC_TOLERANCE_WITH_DATUM_REFERENCE((#90024))"
    "GEOMETRIC_TOLERANCE_WITH_MODIFIERS((.MAXIMUM_MATERIAL_REQUIREMENT.,.FREE_STATE.))POSITION_TOLERANCE());",
    "#90024=DATUM_SYSTEM('',$,#4,.F.,(#90025,#90026));",
    "#90025=DATUM_REFERENCE_COMPARTMENT('',$,#4,.F.,#90031,$);",
    "#90026=DATUM_REFERENCE_COMPARTMENT('',$,#4,.F.,COMMON_DATUM_LIST((#90027,#90028)),$);",
    "#90027=DATUM_REFERENCE_ELEMENT('',$,#4,.F.,#90032,$);"
    "#90028=DATUM_REFERENCE_ELEMENT('',$,#4,.F.,#90033,(SIMPLE_DATUM_REFERENCE_MODIFIER(.FREE_STATE.)));",
    "#90031=DATUM('',$,#4,.F.,'A');#90032=DATUM('',$,#4,.F.,'B');#90033=DATUM('',$,#4,.F.,'C');",
    *(f"#{90030 + 10 * k}=DATUM_FEATURE('','',#4,.T.);#{90031 + 10 * k}=SHAPE_ASPECT_RELATIONSHIP('',$,#{90030 + 10 * k},"
      f"#{90030 + k});" + usage(90032 + 10 * k, 90030 + 10 * k, 2 + k) for k in (1, 2, 3)),
    "#90070=TOLERANCE_ZONE('',$,#4,.F.,(#90023),#90071);#90071=TOLERANCE_ZONE_FORM('cylindrical or circular');",
    "#90072=PROJECTED_ZONE_DEFINITION(#90070,(),#4,#90073);", mm(90073, 5),
    "#90080=(FLATNESS_TOLERANCE()GEOMETRIC_TOLERANCE('','',#90010,#90011)GEOMETRIC_TOLERANCE_WITH_DEFINED_AREA_UNIT(.SQUARE.,$)"
    "GEOMETRIC_TOLERANCE_WITH_DEFINED_UNIT(#90020));",
    "#90100=DIMENSIONAL_SIZE(#90021,'diameter');", item(90101, 10, "nominal value"), values(90102, 90100, 90101),
    deviations(90104, 90100, -0.2, 0.3),
    DEGREE, "#90110=ANGULAR_LOCATION('angle',$,#90011,#90021,.EQUAL.);",
    item(90111, 60, "nominal value", "PLANE_ANGLE", "#90004"), values(90112, 90110, 90111),
    deviations(90114, 90110, -0.5, 0.25, "PLANE_ANGLE", "#90004"),
    "#90120=DIMENSIONAL_SIZE(#90021,'radius');", item(90121, 4.5, "lower limit"), item(90122, 5, "nominal value"),
    item(90123, 5.5, "upper limit"), values(90124, 90120, 90121, 90122, 90123),
    "#90130=DIMENSIONAL_SIZE(#90021,'diameter');", item(90131, 10, "nominal value"), values(90132, 90130, 90131),
    "#90134=PLUS_MINUS_TOLERANCE(#90135,#90130);#90135=LIMITS_AND_FITS('H','hole','7','');",
)  # fmt: skip
LOST_LIMIT = "dimension 3: limits 4.5 to 5.5, kernel 5 to 5.5"


def write(path, *data):
    """Write the cover with tolerances and dimensions; the numbers of its records do not follow their places."""
    text = re.sub(r"FILE_SCHEMA\(.*?\);", f"FILE_SCHEMA(('{AP242 % 1}'));", COVER.read_text(), flags=re.DOTALL)
    faces = re.findall(r"#\d+", re.search(r"CLOSED_SHELL\('',\((.*?)\)", text, re.DOTALL)[1])
    records = "\n".join((*DATA, *data)).replace("@mm", re.search(r"(#\d+) = \( LENGTH_UNIT", text)[1])
    records = re.sub(r"@(\d+)", lambda match: faces[int(match[1]) - 1], records)
    end = text.rindex("ENDSEC;")
    path.write_text(text[:end] + records + "\n" + text[end:])
    return path


@pytest.fixture(scope="module")
def path(tmp_path_factory):
    return write(tmp_path_factory.mktemp("cover") / "cover.stp")


@pytest.fixture(scope="module")
def kernel(path):
    return kernel_annotations(path)


def test_the_kernel_reads_the_same_but_for_what_it_is_known_to_lose(path, kernel):
    pmi = tc.io.read_pmi(path)
    reading = compare(pmi, kernel, {})
    assert [str(difference) for difference in reading.differences] == [LOST_LIMIT]
    assert (reading.tolerances, reading.dimensions, reading.unlisted) == (2, 4, ())
    assert (reading.unread_tolerances, reading.unread_dimensions) == ((3,), ())
    assert "the kernel does not read tolerances 3" in str(reading)


def test_the_kernel_s_reading_has_the_numbers_of_the_file(path, kernel):
    flatness, position = kernel.tolerances
    assert (flatness.record, flatness.kind, flatness.value, flatness.datums) == (90013, "flatness", 0.05, ())
    assert (position.record, position.zone, position.projected) == (90023, "diameter", 5.0)
    assert position.modifiers == {"maximum material requirement", "free state"}
    assert position.datums == ((("A",), frozenset()), (("B", "C"), frozenset({"free state"})))
    size, angle, _, fit = kernel.dimensions
    assert (size.record, size.nominal, size.deviations, size.is_angular) == (90100, 10, (0.2, 0.3), False)
    assert (angle.is_angular, angle.deviations) == (True, (0.5, 0.25)) and angle.nominal == pytest.approx(60)
    assert (fit.has_fit, size.has_fit) == (True, False)
    assert [len(items.face_records) for items in (angle.items, angle.end_items, size.items, size.end_items)] == [1, 1, 1, 0]


@pytest.mark.parametrize(
    "number, change, words",
    [
        (1, {"kind": "roundness"}, "kind flatness, kernel roundness"),
        (1, {"value": 0.0500000001}, "value 0.05, kernel 0.0500000001"),
        (2, {"zone": ""}, "zone cylindrical or circular, kernel none"),
        (2, {"projected": None}, "projected length 5, kernel none"),
        (2, {"modifiers": frozenset({"free state"})}, "modifiers free state, maximum material requirement, kernel free state"),
        (1, {"extent": "all around"}, "extent none, kernel all around"),
        (2, {"datums": ((("A",), frozenset()),)}, "datums A | B-C (F), kernel A"),
        (2, {"datums": ((("A",), frozenset()), (("B", "C"), frozenset()))}, "datums A | B-C (F), kernel A | B-C"),
        (1, {"items": KernelItems(frozenset(), 2)}, "faces #FACE, kernel 2 edges or points"),
        (1, {"items": KernelItems(frozenset({7}), 0)}, "faces #FACE, kernel #7"),
    ],
)
def test_a_tolerance_that_differs_is_told(path, kernel, number, change, words):
    pmi = tc.io.read_pmi(path)
    tolerances = [replace(one, **change) if k == number else one for k, one in enumerate(kernel.tolerances, 1)]
    first, *_ = compare(pmi, replace(kernel, tolerances=tuple(tolerances)), {}).differences
    face = pmi.tolerances[number - 1].face_records[0]
    assert str(first) == f"tolerance {number}: {words}".replace("FACE", str(face))


@pytest.mark.parametrize(
    "number, change, words",
    [
        (1, {"nominal": 10.1}, "nominal value 10, kernel 10.1"),
        (1, {"is_angular": True}, "kind size, kernel angle"),
        (1, {"deviations": (0.2, 0.2)}, "limits 9.8 to 10.3, kernel 9.8 to 10.2"),
        (1, {"deviations": None}, "limits 9.8 to 10.3, kernel none"),
        (1, {"deviations": None, "limits": (9.8, 10.4)}, "limits 9.8 to 10.3, kernel 9.8 to 10.4"),
        (2, {"nominal": 30.0}, "nominal value 1.047197551, kernel 0.5235987756"),
        (2, {"end_items": KernelItems(frozenset(), 0)}, "faces of the end #FACE, kernel none"),
        (4, {"has_fit": False}, "fit H7 hole, kernel none"),
    ],
)
def test_a_dimension_that_differs_is_told(path, kernel, number, change, words):
    pmi = tc.io.read_pmi(path)
    dimensions = [replace(one, **change) if k == number else one for k, one in enumerate(kernel.dimensions, 1)]
    texts = [str(difference) for difference in compare(pmi, replace(kernel, dimensions=tuple(dimensions)), {}).differences]
    face = (*pmi.dimensions[number - 1].end_face_records, 0)[0]
    assert f"dimension {number}: {words}".replace("FACE", str(face)) in texts


def test_a_lower_limit_above_the_nominal_value_agrees(path, kernel):
    size, *others = tc.io.read_pmi(path).dimensions
    pmi = replace(tc.io.read_pmi(path), dimensions=(replace(size, lower=10.2), *others))
    assert [str(difference) for difference in compare(pmi, kernel, {}).differences] == [LOST_LIMIT]


def test_words_that_the_kernel_has_not_are_no_difference(path, kernel):
    flatness, position, unread = tc.io.read_pmi(path).tolerances
    datums = (replace(position.datums[0], modifiers=("distance 5",)), position.datums[1])
    pmi = replace(tc.io.read_pmi(path), tolerances=(flatness, replace(position, datums=datums, zone="within a sphere"), unread))
    spherical = replace(kernel.tolerances[1], zone="spherical diameter")
    kernel = replace(kernel, tolerances=(kernel.tolerances[0], spherical))
    assert [str(difference) for difference in compare(pmi, kernel, {}).differences] == [LOST_LIMIT]


def test_annotations_that_only_one_reading_has_are_told(path, kernel):
    pmi = replace(tc.io.read_pmi(path), tolerances=(), dimensions=())
    assert compare(pmi, kernel, {}).unlisted[:2] == ("a flatness of 0.05 mm, #90013", "a position of 0.25 mm, #90023")
    reading = compare(tc.io.read_pmi(path), replace(kernel, tolerances=(), dimensions=()), {})
    assert (reading.unread_tolerances, reading.unread_dimensions) == ((1, 2, 3), (1, 2, 3, 4))


@pytest.mark.parametrize(
    "record, words",
    [
        ("#91000=TOLERANCE_ZONE('',$,#4,.F.,(#90013),$);", "the library that reads it crashed (signal 11)"),
        (f"&SCOPE #91000={ASPECT}; ENDSCOPE #91001={ASPECT};", "records, and the file has"),
    ],
)
def test_a_kernel_that_fails_loses_nothing_but_its_reading(tmp_path, record, words):
    path = write(tmp_path / "cover.stp", record)
    reading = second_reading(tc.io.read_pmi(path), path, {})
    assert reading.fault.startswith("the kernel could not read the PMI: ") and words in str(reading)
    assert reading.differences == () and len(tc.io.read_pmi(path).tolerances) == 3


def test_a_file_without_shapes_has_no_second_reading(tmp_path):
    path = tmp_path / "text.stp"
    path.write_text(step("#20=FLATNESS_TOLERANCE('','',$,$);"))
    with pytest.raises(GeometryFault, match=r"the kernel could not read the PMI: .*holds no shape"):
        kernel_annotations(path)
