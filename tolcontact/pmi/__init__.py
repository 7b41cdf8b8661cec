"""Read the tolerances, dimensions and datums that a STEP file states.

.. include:: ../guide/pmi.md
"""

from tolcontact.pmi.annotations import OF_DATUMS, OF_TOLERANCES, Datum, DatumReference, DatumTarget, Dimension, Pmi, Tolerance
from tolcontact.pmi.claims import DeclaredAnnotation
from tolcontact.pmi.declared import DeclaredPmi, features_from_pmi
from tolcontact.pmi.reading import read_pmi

__all__ = [
    "OF_DATUMS", "OF_TOLERANCES", "Datum", "DatumReference", "DatumTarget", "DeclaredAnnotation", "DeclaredPmi", "Dimension",
    "Pmi", "Tolerance", "features_from_pmi", "read_pmi",
]  # fmt: skip
