"""A solver of contact QPs on the graph of bodies: `tc.build(model, solver="graph")`.

The objective has unit blocks on its diagonal, and a row touches few bodies, so that most of the matrices is empty. The rows
that carry are sought as those of a least-distance problem (H is the identity): multipliers solve the Gram matrix of the rows,
whose Cholesky factor follows the joints in an order of minimum degree. If H couples bodies, as in Newton's steps and for parts
located on others, its block Cholesky factor takes it to the rows first. Each realization is solved from its data alone: its
answer does not depend on others.

elimination, layout   which bodies a row touches, and the orders of elimination, from the sparsity, once
factor_kernel         the Gram matrix of the rows that carry
active_set_kernel     how rows enter and leave, and slacks open and close
search_kernel         in which order: in all joints at once, then one by one
hessian_kernel        the factor of H
solve_kernel          a batch of QPs
graph_solver          the solver, in place of a plugin of CasADi
"""

from tolcontact.compilation.graph.graph_solver import GraphSolver, Layouts

__all__ = ["GraphSolver", "Layouts"]
