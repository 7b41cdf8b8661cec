"""Elasticity: a part as a free elastic body, from its own mesh of tetrahedra or from an imported stiffness matrix.

.. include:: ../guide/elasticity.md
"""

from tolcontact.elasticity.bodies import elastic_body
from tolcontact.elasticity.elastic_body import ElasticBody, flexibility, responses
from tolcontact.elasticity.imported_body import MAX_OFFSET
from tolcontact.elasticity.node_table import node_table
from tolcontact.elasticity.sources import MatrixSource, MeshSource

__all__ = ["MAX_OFFSET", "ElasticBody", "MatrixSource", "MeshSource", "elastic_body", "flexibility", "node_table", "responses"]
