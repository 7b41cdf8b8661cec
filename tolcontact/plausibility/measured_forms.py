"""Measured faces whose form is beyond the tolerance by which it is declared."""

from collections.abc import Iterator
from pathlib import Path

from tolcontact.errors import designation
from tolcontact.plausibility.trial_draws import TrialDraws

ROUNDING = 1e-6  # of the width


def measured_forms(draws: TrialDraws) -> Iterator[str]:
    """Yield a sentence for each feature with measured faces that lie in no zone of the stated width."""
    for pattern in draws.program.nominal.patterns:
        for member in pattern.members:
            if member.form is None or pattern.form is None:
                continue
            stated, widths = float(pattern.form.width), member.form.scans
            beyond = [path for path, width in widths.items() if width > (1 + ROUNDING) * stated]
            if beyond:
                worst = max(beyond, key=lambda path: widths[path])
                yield (
                    f'part "{member.feature.part.name}": {designation(member.feature.noun, member.feature)}: '
                    f"{len(beyond)} of {len(widths)} measured faces are beyond the {pattern.form.kind} of {stated:.4g} mm that "
                    f'is stated; "{Path(worst).name}" has {widths[worst]:.3g} mm; forms are drawn as they were measured, so '
                    "check the tolerance, and the files for outliers"
                )
