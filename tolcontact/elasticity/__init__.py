"""Elasticity: a part as a free elastic body, from its own mesh of tetrahedra or from an imported stiffness matrix.

.. include:: ../guide/elasticity.md
"""

from tolcontact.elasticity.bodies import elastic_body
from tolcontact.elasticity.elastic_body import ElasticBody, flexibility
from tolcontact.elasticity.sources import MatrixSource, MeshSource

__all__ = ["ElasticBody", "MatrixSource", "MeshSource", "elastic_body", "flexibility"]
