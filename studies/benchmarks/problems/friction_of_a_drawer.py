"""The friction from which on a drawer jams."""

from studies.benchmarks.friction import least_coefficient
from studies.benchmarks.problem import numbers

N = numbers(__file__)


def solution():
    return (N.length / (2 * N.off),)


def check():
    # The push turns the drawer against the guides at opposite corners.
    x, y = N.length / 2, N.width / 2
    contacts = ([((-x, -y), (0, 1)), ((x, y), (0, -1))], [((x, -y), (0, 1)), ((-x, y), (0, -1))])
    return (min(least_coefficient(pair, [((0, N.off), (N.push, 0))]) for pair in contacts),)
