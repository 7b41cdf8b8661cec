"""The middle force of a beam on three supports."""

from studies.benchmarks.beams import beam_stiffness, condensed
from studies.benchmarks.problem import numbers

N = numbers(__file__)
BENDING = N.E * N.width * N.h**3 / 12


def solution():
    return (48 * BENDING * N.d / N.length**3,)


def check():
    return (condensed(beam_stiffness(N.length, 20, BENDING), [0, 20, 40])[1] @ [0, N.d, 0],)
