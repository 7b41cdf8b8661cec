"""Doc."""

from tolcontact.pmi.annotations import Datum, DatumReference, DatumTarget, Dimension, Pmi, Tolerance
from tolcontact.pmi.reading import read_pmi

__all__ = ["Datum", "DatumReference", "DatumTarget", "Dimension", "Pmi", "Tolerance", "read_pmi"]
