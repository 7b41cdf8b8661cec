"""Every variable of a population that was measured back."""

from tolcontact.vocabulary.summary import INTERVAL
from tolcontact.vocabulary.variable import ArchiveVariable

ZONE = "zone"
ZONE_FEATURE = ArchiveVariable("feature", (ZONE,), str, "feature, as part.feature")
ZONE_TOLERANCE = ArchiveVariable("zone_tolerance", (ZONE,), str, "tolerance, and the rule from its zone to the spread")
STATED_SHARE = ArchiveVariable(
    "stated_share", (ZONE,), "f8", "share of features inside that the rule states; NaN if it states none", "1"
)
SHARE_INSIDE = ArchiveVariable(
    "share_inside", (ZONE, INTERVAL), "f8", "share of drawn features that were measured to be inside", "1"
)
NEEDED_WIDTH = ArchiveVariable("needed_width", (ZONE,), "f8", "width of the zone that 99.73 % of the drawn features need", "mm")
OF_ZONES = (ZONE_FEATURE, ZONE_TOLERANCE, STATED_SHARE, SHARE_INSIDE, NEEDED_WIDTH)
