"""A solver of contact QPs on the graph of bodies."""

from tolcontact.compilation.graph.graph_solver import GraphSolver

__all__ = ["GraphSolver"]
