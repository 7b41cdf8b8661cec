"""Check whether the nominal assembly is plausible, and warn of probable mistakes.

.. include:: ../guide/plausibility.md
"""

from tolcontact.plausibility.drawing import drawing_remarks
from tolcontact.plausibility.elastic_checks import elastic_remarks
from tolcontact.plausibility.nominal_check import KINDS, warn_of_nominal

__all__ = ["KINDS", "drawing_remarks", "elastic_remarks", "warn_of_nominal"]
