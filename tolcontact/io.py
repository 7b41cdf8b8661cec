"""Read shapes and tolerances from CAD files, planes from measured points, and models from archives; write models as JSON."""

from tolcontact.archive import model_of
from tolcontact.discretization import measured_planes
from tolcontact.geometry import bodies_in, faces_in, parts_from
from tolcontact.pmi import features_from_pmi, read_pmi
from tolcontact.workflow import write_model

__all__ = ["bodies_in", "faces_in", "features_from_pmi", "measured_planes", "model_of", "parts_from", "read_pmi", "write_model"]
