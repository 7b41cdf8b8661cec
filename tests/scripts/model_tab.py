"""A model script: a tab wider than its slot, which has no floor."""

from tests import cases


def assembly():
    return cases.tab(tolerance=0.01, floor=False)
