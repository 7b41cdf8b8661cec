"""A solver of contact QPs on the graph of bodies: `tc.build(model, solver="graph")`.

The objective has unit blocks on its diagonal, and a row touches few bodies, so that the matrices are sparse. The active set is
found by a least-distance problem (H is the identity): multipliers solve the Gram matrix of the active rows, whose Cholesky
factorization eliminates the joints in minimum-degree order. If H couples bodies, as in Newton's steps and for parts located on
others, its block Cholesky factor first transforms the rows. Each realization is solved from its own data: its answer does not
depend on other realizations.

factor_kernel         the factors of the Gram matrix of the active rows, and of H
active_set_kernel     changes of the active set: rows enter and leave, slacks open and close
solve_kernel          a batch of QPs: the search for the active set, in all joints at once, then one by one
graph_solver          the solver, its entry in the table of solvers, and the elimination orders, from the sparsity, once
"""

from tolcontact.compilation.graph.graph_solver import GraphChoice, GraphSolver

__all__ = ["GraphChoice", "GraphSolver"]
