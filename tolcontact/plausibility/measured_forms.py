"""Measured faces whose form is beyond the tolerance by which it is declared, or that the form field does not follow."""

from collections.abc import Iterator, Mapping
from pathlib import Path

from tolcontact.errors import designation
from tolcontact.features.form_field import ScanFit
from tolcontact.plausibility.trial_draws import TrialDraws

ROUNDING = 1e-6  # of the width
LOST_SHARE = 0.05  # of the form: more that the field leaves out is said
SCATTER_SHARE = 0.5  # the same of scatter about the field
EXCESS = 1.25  # times the largest height at the points: the same between or beside them
OUTLYING = 10.0  # times the scatter of points about the field, and
OUTLYING_SHARE = 0.2  # of the width of the zone: a point farther away is an outlier


def measured_forms(draws: TrialDraws) -> Iterator[str]:
    """Yield sentences on features with measured faces: beyond their tolerance of form, or not as their points are."""
    for pattern in draws.program.nominal.patterns:
        for member in pattern.members:
            if member.form is None or pattern.form is None:
                continue
            owner = f'part "{member.feature.part.name}": {designation(member.feature.noun, member.feature)}'
            stated, scans = float(pattern.form.width), member.form.scans
            for sentence in (*_beyond(stated, pattern.form.kind, scans), *_unlike(scans)):
                yield f"{owner}: {sentence}"


def _beyond(stated: float, kind: str, scans: Mapping[str, ScanFit]) -> Iterator[str]:
    """Yield a sentence if measured faces lie in no zone of the stated width [mm]."""
    beyond = [path for path, scan in scans.items() if scan.width > (1 + ROUNDING) * stated]
    if beyond:
        worst = max(beyond, key=lambda path: scans[path].width)
        yield (
            f"{len(beyond)} of {len(scans)} measured faces are beyond the {kind} of {stated:.4g} mm that is stated; "
            f'"{Path(worst).name}" has {scans[worst].width:.3g} mm; forms are drawn as they were measured, so check the '
            "tolerance, and the files for outliers"
        )


def _unlike(scans: Mapping[str, ScanFit]) -> Iterator[str]:
    """Yield a sentence for each way in which the form field differs from the points of measured faces, of the worst one."""
    if not scans:
        return
    path, scan = max(scans.items(), key=lambda item: item[1].lost)
    if scan.lost > LOST_SHARE * scan.height:
        yield (
            f'the form that is drawn leaves out {scan.lost:.2g} mm of the {scan.height:.2g} mm of "{Path(path).name}" (root '
            f"mean square), and up to {scan.farthest:.2g} mm: it changes over too short lengths; filter short waves out of the "
            "points"
        )
    else:
        path, scan = max(scans.items(), key=lambda item: item[1].scatter)
        if scan.scatter > SCATTER_SHARE * scan.height:
            yield (
                f'the points of "{Path(path).name}" scatter by {scan.scatter:.2g} mm about a form of {scan.height:.2g} mm '
                "(root mean square): neighbours do not agree, so this is not drawn; if it is form, measure closer points"
            )
    path, scan = max(scans.items(), key=lambda item: item[1].excess)
    if scan.excess > EXCESS:
        yield (
            f'the form of "{Path(path).name}" is up to {scan.excess:.2g} times as high between or beside its points as at '
            "them; measure more points, also along the rim"
        )
    path, scan = max(scans.items(), key=lambda item: item[1].farthest)
    if scan.farthest > max(OUTLYING * scan.scatter, OUTLYING_SHARE * scan.width):
        yield (
            f'a point of "{Path(path).name}" is {scan.farthest:.2g} mm away from the form that its neighbours show; check the '
            "file for outliers, which change the form around them"
        )
