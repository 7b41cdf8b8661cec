"""The check of the nominal assembly: all kinds of warnings, by their names."""

import warnings
from collections.abc import Callable, Iterator

from tolcontact.compilation import Program
from tolcontact.errors import NominalWarning
from tolcontact.plausibility.bodies import body_overlaps, clashes, clashes_beyond_faces
from tolcontact.plausibility.declared_points import doubtful_units, far_points, stored_coordinates, unfit_directions
from tolcontact.plausibility.effects import unfollowed_by_locators, unfollowed_by_measures, unused_features, unvaried
from tolcontact.plausibility.elastic_checks import large_bending, unresolved_nominal
from tolcontact.plausibility.faces import measured_forms, partial_surfaces
from tolcontact.plausibility.measures import assumed_sides, measure_limits, measured_reach, rotations, wide_tolerances
from tolcontact.plausibility.pairs import (
    coarse_pairs,
    free_turns,
    pair_clearances,
    pair_overlaps,
    repeated_pairs,
    unconstrained_rotations,
    unsure_seats,
    unused_forces,
)
from tolcontact.plausibility.scale import out_of_scale
from tolcontact.plausibility.trial_draws import TrialDraws
from tolcontact.texts import shown

KINDS: dict[str, tuple[Callable[[TrialDraws], Iterator[str]], ...]] = {
    "units": (doubtful_units, out_of_scale),
    "face": (partial_surfaces,),
    "coarse": (coarse_pairs, stored_coordinates),
    "angle": (rotations,),
    "point": (far_points,),
    "direction": (unfit_directions,),
    "tolerance": (wide_tolerances,),
    "overlap": (pair_overlaps, body_overlaps),
    "clash": (clashes, clashes_beyond_faces),
    "gap": (pair_clearances,),
    "twice": (repeated_pairs,),
    "rotation": (unconstrained_rotations, free_turns),
    "limits": (measure_limits,),
    "side": (assumed_sides,),
    "reach": (measured_reach,),
    "force": (unused_forces,),
    "friction": (unsure_seats,),
    "form": (measured_forms,),
    "bending": (large_bending, unresolved_nominal),
    "effect": (unfollowed_by_measures, unfollowed_by_locators, unused_features, unvaried),
}


def warn_of_nominal(program: Program) -> None:
    """Issue a NominalWarning for everything in the nominal assembly that is probably a mistake."""
    draws = TrialDraws.of(program)
    for kind, checks in KINDS.items():
        for check in checks:
            for sentence in check(draws):
                warnings.warn(f"[{kind}] {shown(sentence)}", NominalWarning, stacklevel=4)
