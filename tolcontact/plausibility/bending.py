"""Elastic parts in the nominal assembly: bending beyond the theory, and a state that contact does not find."""

from collections.abc import Iterator

from tolcontact.plausibility.trial_draws import TrialDraws
from tolcontact.vocabulary import CERTIFIED, Status

MAX_SHARE = 0.1  # of the size of a part: the stiffness of a part that bends further is not that of its undeformed shape


def large_bending(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each elastic part that bends too far in the nominal assembly for a theory of small displacements."""
    bending, parts = draws.program.bending, draws.program.nominal.parts
    for index, bent in bending.parts.items() if bending else ():
        bend, size = bent.largest_displacement(draws.nominally_resolved.load[0]), float(parts[index].mesh.scale)
        if bend > MAX_SHARE * size:
            yield (
                f"{parts[index].part.designation}: it bends by {bend:.3g} mm in the nominal assembly, and is {size:.3g} mm "
                "large, beyond a theory of small displacements; check its forces, its supports, and its modulus or "
                "the units of its stiffness"
            )


def unresolved_nominal(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence if contact of elastic parts is not resolved in the nominal assembly."""
    if draws.program.bending and (status := Status(draws.nominally_resolved.status[0])) not in CERTIFIED:
        yield (
            f"the nominal assembly, which has elastic parts, is {status.name.lower()}; check that locators and contact hold "
            "each part against its forces, and that stops leave a place for it"
        )
