"""Elastic bodies of sources, each made once: parts that are equal share one."""

from tolcontact.elasticity.elastic_body import ElasticBody
from tolcontact.elasticity.imported_body import imported_body
from tolcontact.elasticity.meshed_body import meshed_body
from tolcontact.elasticity.sources import MatrixSource, MeshSource


def elastic_body(source: MeshSource | MatrixSource) -> ElasticBody:
    """Return the elastic body of a source. Raises GeometryFault, which names the file, for anything that cannot be used."""
    if isinstance(source, MeshSource):
        return meshed_body(source)
    surface = None if source.vertices is None or source.faces is None else (source.vertices, source.faces)
    return imported_body(source.stiffness, source.nodes, surface, source.tolerance)
