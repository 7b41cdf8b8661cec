"""Matrix products with a symmetric result."""

import casadi as ca


def congruent(B: ca.SX, A: ca.SX) -> ca.SX:
    """Return A'BA (n, n) for a symmetric B (m, m) and A (m, n). The lower triangle is a copy of the upper one."""
    product = B @ A
    entries = ca.triu(ca.mtimes(A.sparsity().T, product.sparsity()))
    return ca.triu2symm(ca.mac(A.T, product, ca.SX.zeros(entries)))
