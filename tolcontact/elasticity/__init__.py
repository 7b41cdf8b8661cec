"""Elasticity: a part as a free elastic body, from its own mesh of tetrahedra or from an imported stiffness matrix.

.. include:: ../guide/elasticity.md
"""

from tolcontact.elasticity.elastic_body import ElasticBody, flexibility, responses
from tolcontact.elasticity.imported_body import MAX_OFFSET, imported_body, node_table
from tolcontact.elasticity.meshed_body import meshed_body

__all__ = ["MAX_OFFSET", "ElasticBody", "flexibility", "imported_body", "meshed_body", "node_table", "responses"]
