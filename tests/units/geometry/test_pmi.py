"""Insides of `geometry` under the claims of `tests/test_pmi.py`."""

import csv
import io
import json
import re

import pytest

import tolcontact as tc
from tests.helpers import call
from tests.test_cad import COVER
from tests.test_pmi import AP242, POSITION, step
from tolcontact.errors import OptionError
from tolcontact.geometry.listing import faces_of_records


def cover_with_pmi(path):
    """The cover with a flatness of its second face, between texts and comments that hold signs of records."""
    text = COVER.read_text()
    text = re.sub(r"FILE_SCHEMA\(.*?\);", f"FILE_SCHEMA(('{AP242 % 1}'));", text, flags=re.DOTALL)
    faces = [int(number) for number in re.findall(r"#(\d+)", re.search(r"CLOSED_SHELL\('',\((.*?)\)", text, re.DOTALL)[1])]
    length = re.search(r"#(\d+) = \( LENGTH_UNIT", text)[1]
    more = f"""/* ; #5 = X( ' */ #90002=DESCRIPTIVE_REPRESENTATION_ITEM('/* no comment','it''s; #8=');
#90001=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.05),#{length});
#90003=FLATNESS_TOLERANCE('it''s; #7 = ','',#90001,#90004); #90004=SHAPE_ASPECT('','',#9,.T.);
#90005=GEOMETRIC_ITEM_SPECIFIC_USAGE('','',#90004,#8,#{faces[1]});
"""
    end = text.rindex("ENDSEC;")
    path.write_text(text[:end] + more + text[end:])
    return faces


def test_faces_of_tolerances_have_the_numbers_of_the_listing(tmp_path):
    path = tmp_path / "cover.stp"
    records = cover_with_pmi(path)
    found = faces_of_records(path)
    assert [found[record].number for record in records] == list(range(1, len(records) + 1))
    done = call(tmp_path, "pmi", path.name)
    assert done.returncode == 0, done.stderr
    (row,) = [line for line in done.stdout.splitlines() if "flatness" in line]
    assert row.split() == ["1", "flatness", "0.05", "plane", "2", "plane", "2"]  # the face, and the feature that is declared
    (row,) = csv.DictReader(io.StringIO(call(tmp_path, "pmi", path.name, "--csv").stdout))
    assert (row["faces"], row["face_records"]) == ("2", str(records[1]))
    assert (row["features"], row["reason"]) == ("plane 2", "")
    data = json.loads(call(tmp_path, "pmi", path.name, "--json").stdout)
    assert data["faces"][str(records[4])] == {"number": 5, "name": "", "bodies": [1], "kind": ""}
    assert not faces_of_records(COVER)


def test_a_face_that_stands_twice_has_one_number_for_both_of_its_records(tmp_path):
    path = tmp_path / "cover.stp"
    records = cover_with_pmi(path)
    text = path.read_text()
    face = re.search(rf"#{records[1]} = ADVANCED_FACE", text)[0]
    body = text[text.index(face) + len(face) : text.index(";", text.index(face))]
    shell = re.search(r"CLOSED_SHELL\('',\((#\d+,#\d+)", text)
    copies = text[: shell.start(1)] + shell[1] + ",#90100,#90101" + text[shell.end(1) :]
    end = copies.rindex("ENDSEC;")
    path.write_text(copies[:end] + "".join(f"#{n} = ADVANCED_FACE{body};\n" for n in (90100, 90101)) + copies[end:])
    listing = tc.io.faces_in(path)  # the kernel mends the solid, and the face that stands thrice is its last one
    (face,) = [face for face in listing if face.copies]
    assert face.copies == 2 and "occurs 3 times in the file" in str(face)
    assert face.direction == (0, 0, 1) and face.point[2] == 8 and "times" not in str(listing[0])
    found = {record: face.number for record, face in faces_of_records(path).items()}
    assert {found.pop(record) for record in (records[1], 90100, 90101)} == {face.number}
    assert len(found) == len(set(found.values())) == 14 and face.number not in found.values()


@pytest.mark.parametrize(("suffix", "words"), [(".p21", "unknown kind of file"), (".stl", "is a STEP file by its content")])
def test_faces_of_a_file_that_is_not_called_a_step_file_are_refused(suffix, words, tmp_path):
    path = tmp_path / f"part{suffix}"
    path.write_text(step(*POSITION))
    with pytest.raises(OptionError, match=words):
        faces_of_records(path)
