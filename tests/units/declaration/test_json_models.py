"""Insides of `declaration` under the claims of `tests/test_json_models.py`."""

import inspect

from tolcontact.declaration.codec import named_codecs
from tolcontact.declaration.document import CODECS_OF_LISTS
from tolcontact.declaration.record import Record


def test_every_field_of_a_declared_class_stands_in_the_document():
    records = [codec for codec in named_codecs(*CODECS_OF_LISTS).values() if isinstance(codec, Record)]
    assert len(records) > 40
    for record in records:
        missing = {name for name in inspect.signature(record.cls).parameters if name not in record.names}
        assert missing <= {"part", "of"} or record.name in ("ArchivedMesh", "CylinderCriterion"), record.cls
