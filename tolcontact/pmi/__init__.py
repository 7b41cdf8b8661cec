"""Read the tolerances, dimensions and datums that a STEP file states. A chapter of the guide.

A STEP file of AP242 can state the product and manufacturing information (PMI) of a drawing as data: geometric tolerances,
dimensions and datums, with the faces to which they apply. `tc.read_pmi` reads them, and `tolcontact pmi FILE.stp` lists them
as tables, JSON or CSV. Lengths are in mm and angles in rad, regardless of the units of the file.

>>> import tolcontact as tc
>>> from pathlib import Path
>>> from tempfile import mkdtemp
>>> text = '''ISO-10303-21;
... HEADER;
... FILE_SCHEMA(('AP242_MANAGED_MODEL_BASED_3D_ENGINEERING_MIM_LF { 1 0 10303 442 1 1 4 }'));
... ENDSEC;
... DATA;
... #1=(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT(.MILLI.,.METRE.));
... #2=LENGTH_MEASURE_WITH_UNIT(LENGTH_MEASURE(0.05),#1);
... #3=FLATNESS_TOLERANCE('top','',#2,#4);
... #4=SHAPE_ASPECT('','',#9,.T.);
... #5=GEOMETRIC_ITEM_SPECIFIC_USAGE('','',#4,#8,#6);
... #6=ADVANCED_FACE('',(),#7,.T.);
... ENDSEC;
... END-ISO-10303-21;
... '''
>>> path = Path(mkdtemp()) / "plate.stp"
>>> _ = path.write_text(text)
>>> pmi = tc.read_pmi(path)
>>> pmi
AP242 edition 1: 1 tolerances, 0 dimensions, 0 datums
>>> flatness, = pmi.tolerances
>>> flatness.kind, flatness.value, flatness.face_records
('flatness', 0.05, (6,))

| attribute of the result | content |
|---|---|
| `tolerances` | kind, value, form of the zone, modifiers, datum system, area per unit, composite frames |
| `dimensions` | sizes, distances and angles: nominal value, limits, class of the fit, modifiers |
| `datums` | letters, datum features, datum targets |
| `edition`, `schema`, `is_ap242` | the application protocol |
| `is_tessellated` | whether shapes are triangles only, without faces to which tolerances could apply |
| `drawings` | number of annotations that are only drawn; drawings are not read |

## Faces

`face_records` are the numbers of B-rep faces in the text of the file, `other_records` those of edges, curves and points: a
tolerance of a thread is often stated on curves. Patterns, groups and derived features, such as a centre of symmetry, are
resolved into their faces. A tolerance of the whole product (`extent` "all over") has all faces of the file. Some tolerances
have no faces, because the file states none. `tolcontact pmi FILE.stp` gives the numbers that `tolcontact faces` lists.

## Features

`tc.features_from_pmi(part)` declares what features can state (see `tolcontact.features`), and returns every annotation with its
features, or with the reason why it has none. `tolcontact pmi FILE.stp` lists the same, and `--script` writes a model script
with these features, as a starting point.

| stated in the file | declared as |
|---|---|
| faces that lie in one plane, or on one cylinder, cone, sphere or torus | one feature |
| a size, position or symmetry of two opposed planes | a slot or a tab |
| a size | the size of the shape, with the limits of the file about it |
| a position of several like features, a composite frame, a common zone | a pattern |
| the lower segment of a composite frame | a tolerance whose datums lock directions alone, "A><" |
| a datum of several surfaces | a pattern of their features |
| datum targets at points | targets on the features there; lines and areas stand for their faces |
| an unequally disposed zone | `outside`, the part of the zone out of the material (ASME Y14.5) |

Features are named after the letter of their datum, else after their kind and the number of their first face: "cylinder 12",
"cylinders 12" for a pattern. Not declared are tolerances without faces, of the whole product, or in the free state of a part;
zones between planes for an axis, whose direction is not read; dimensions between features, which are
places that positions tolerance; sizes without limits, or of other surfaces than cylinders, spheres and opposed planes; and
what other tolerances of the same feature imply. The reader assumes that a pattern keeps together, as in ASME Y14.5; under ISO
5458 this needs CZ.

## Limits

Editions 1 to 3 of AP242 are read; edition 4, AP242 XML and QIF are refused by name. A file of AP203 or AP214 is read, but
nothing in it. A feature takes the limits of a fit such as H7 from ISO 286-1. Sizes of datum targets, coordinate systems,
orientations of zones, and occurrences of a part in an assembly are not read. A dimension with a value that has no unit of its
own is listed without it. A damaged file leads to a single message.
"""

from tolcontact.pmi.annotations import Datum, DatumReference, DatumTarget, Dimension, Pmi, Tolerance
from tolcontact.pmi.claims import DeclaredAnnotation
from tolcontact.pmi.declared import DeclaredPmi, features_from_pmi
from tolcontact.pmi.reading import read_pmi

__all__ = [
    "Datum", "DatumReference", "DatumTarget", "DeclaredAnnotation", "DeclaredPmi", "Dimension", "Pmi", "Tolerance",
    "features_from_pmi", "read_pmi",
]  # fmt: skip
