"""Measured faces whose form is beyond the tolerance by which it is declared."""

from collections.abc import Iterator
from pathlib import Path

from tolcontact.errors import designation
from tolcontact.plausibility.trial_draws import TrialDraws

ROUNDING = 1e-6  # of the width


def measured_forms(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each feature with measured faces that lie in no zone as wide as their tolerance of form."""
    for pattern in draws.program.nominal.patterns:
        for member in pattern.members:
            if member.form is None or pattern.form is None:
                continue
            stated, scans = float(pattern.form.width), member.form.scans
            beyond = [path for path, width in scans.items() if width > (1 + ROUNDING) * stated]
            if not beyond:
                continue
            worst = max(beyond, key=lambda path: scans[path])
            yield (
                f'part "{member.feature.part.name}": {designation(member.feature.noun, member.feature)}: {len(beyond)} of '
                f"{len(scans)} measured faces are beyond the {pattern.form.kind} of {stated:.4g} mm that is stated; "
                f'"{Path(worst).name}" has {scans[worst]:.3g} mm; forms are drawn as they were measured, so check the '
                "tolerance, and the files for outliers"
            )
