"""Check whether the nominal assembly is plausible, and warn of probable mistakes.

.. include:: ../guide/plausibility.md
"""

import warnings
from collections.abc import Callable, Iterator

from tolcontact.compilation import Program
from tolcontact.errors import NominalWarning
from tolcontact.plausibility import bodies, declared_points, effects, elastic_checks, faces, measures, pairs, scale
from tolcontact.plausibility.drawing import drawing_remarks
from tolcontact.plausibility.elastic_checks import elastic_remarks
from tolcontact.plausibility.trial_draws import TrialDraws
from tolcontact.texts import shown

__all__ = ["KINDS", "drawing_remarks", "elastic_remarks", "warn_of_nominal"]

KINDS: dict[str, tuple[Callable[[TrialDraws], Iterator[str]], ...]] = {
    "units": (declared_points.doubtful_units, scale.out_of_scale),
    "face": (faces.partial_surfaces,),
    "coarse": (pairs.coarse_pairs, declared_points.stored_coordinates),
    "angle": (measures.rotations,),
    "point": (declared_points.far_points,),
    "direction": (declared_points.unfit_directions,),
    "tolerance": (measures.wide_tolerances,),
    "overlap": (pairs.pair_overlaps, bodies.body_overlaps),
    "clash": (bodies.clashes, bodies.clashes_beyond_faces),
    "gap": (pairs.pair_clearances,),
    "twice": (pairs.repeated_pairs,),
    "rotation": (pairs.unconstrained_rotations, pairs.free_turns),
    "limits": (measures.measure_limits,),
    "side": (measures.assumed_sides,),
    "reach": (measures.measured_reach,),
    "force": (pairs.unused_forces,),
    "friction": (pairs.unsure_seats,),
    "form": (faces.measured_forms,),
    "bending": (elastic_checks.large_bending, elastic_checks.unresolved_nominal),
    "effect": (effects.unfollowed_by_measures, effects.unfollowed_by_locators, effects.unused_features, effects.unvaried),
}


def warn_of_nominal(program: Program) -> None:
    """Issue a NominalWarning for everything in the nominal assembly that is probably a mistake."""
    draws = TrialDraws.of(program)
    for kind, checks in KINDS.items():
        for check in checks:
            for sentence in check(draws):
                warnings.warn(f"[{kind}] {shown(sentence)}", NominalWarning, stacklevel=4)
