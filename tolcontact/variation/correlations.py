"""Coefficients of correlation: of the Gaussian copula, of the deviations (Pearson), and of their ranks (Spearman).

With normal scores z of correlation r, deviations x(z) and y(z) have the Pearson coefficient sum a_k b_k r^k for k from 1, where
a_k and b_k are the coefficients of standardized x and y in normalized Hermite polynomials (Mehler's expansion). Ranks have the
coefficient 6 / pi asin(r / 2).
"""

from collections.abc import Sequence

import numpy as np
import scipy
from scipy.special import ndtr

from tolcontact.declaration import Correlation
from tolcontact.errors import ModelError
from tolcontact.features.freedoms import Freedom

MAX_SCORE, SCORES, TERMS = 8.0, 8001, 80
MIN_EIGENVALUE = 1e-12  # of a matrix of coefficients


def hermite_coefficients(freedom: Freedom) -> np.ndarray:
    """Return the coefficients (term,) of a freedom's standardized deviation, from the first one on; zeros if it is constant."""
    z = np.linspace(-MAX_SCORE, MAX_SCORE, SCORES)
    weights = np.exp(-(z**2) / 2)
    weights /= weights.sum()
    deviations = freedom.deviations(ndtr(z))
    deviations = deviations - weights @ deviations
    polynomials = [np.ones_like(z), z]
    for k in range(1, TERMS):
        polynomials.append((z * polynomials[k] - np.sqrt(k) * polynomials[k - 1]) / np.sqrt(k + 1))
    spread = np.sqrt(weights @ deviations**2)
    return np.array(polynomials[1:]) @ (weights * deviations) / spread if spread > 0 else np.zeros(TERMS)


def pearson(copula: float, first: np.ndarray, second: np.ndarray) -> float:
    """Return the Pearson coefficient for one of the copula, and coefficients (term,) of both deviations."""
    return float((first * second) @ copula ** np.arange(1, TERMS + 1))


def rank(copula: float) -> float:
    """Return the coefficient of ranks (Spearman) for one of the copula."""
    return float(6 / np.pi * np.arcsin(copula / 2))


def copula_matrix(correlation: Correlation, freedoms: Sequence[Freedom], model: str) -> np.ndarray:
    """Return the matrix of the Gaussian copula of a correlation. Raises ModelError for coefficients that cannot exist."""
    matrix = np.array(correlation.matrix)
    if correlation.kind == "copula":
        return matrix
    terms = [hermite_coefficients(freedom) for freedom in freedoms]
    faults = list[str]()
    for row, column in zip(*np.tril_indices(len(matrix), -1), strict=True):
        stated, pair = matrix[row, column], (terms[row], terms[column])
        if correlation.kind == "rank":
            coefficient = 2 * np.sin(np.pi / 6 * stated)
        else:
            low, high = pearson(-1.0, *pair), pearson(1.0, *pair)
            if not low < stated < high:
                first, second = correlation.labels[row], correlation.labels[column]
                faults.append(
                    f'"{first}" and "{second}" have Pearson coefficients from {low:.3f} to {high:.3f} alone, by their '
                    f"distributions, and not {stated:g}"
                )
                continue
            coefficient = scipy.optimize.brentq(lambda r, pair=pair, stated=stated: pearson(r, *pair) - stated, -1, 1)
        matrix[row, column] = matrix[column, row] = coefficient
    if not faults and np.linalg.eigvalsh(matrix).min() < MIN_EIGENVALUE:
        faults.append(f"no Gaussian copula has these {correlation.kind} coefficients together; make them smaller")
    if faults:
        raise ModelError(model, [f"{correlation.designation}: {fault}" for fault in faults])
    return matrix


def in_words(correlation: Correlation, matrix: np.ndarray, freedoms: Sequence[Freedom]) -> str:
    """Return the coefficients of a correlation of all kinds, for the first two contributors, from the matrix of its copula."""
    copula, terms = float(matrix[1, 0]), [hermite_coefficients(freedom) for freedom in freedoms[:2]]
    first, second = correlation.labels[:2]
    return (
        f'correlation of "{first}" and "{second}": copula {copula:.3f}, Pearson {pearson(copula, *terms):.3f}, '
        f"rank {rank(copula):.3f}"
    )
