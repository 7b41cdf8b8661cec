"""What was asked of a model beside its run: names in the group `statistics` of an archive."""

from tolcontact.vocabulary.allocation import ALLOCATION
from tolcontact.vocabulary.contributions import CONTRIBUTIONS
from tolcontact.vocabulary.relocation import RELOCATION
from tolcontact.vocabulary.sensitivities import SENSITIVITIES
from tolcontact.vocabulary.tails import TAILS
from tolcontact.vocabulary.worst_case import WORST_CASE

ANALYSES = "statistics"
OF_CONTRIBUTIONS, OF_SENSITIVITIES, OF_WORST_CASE = "contributions", "sensitivities", "worst_case"
OF_TAILS, OF_ALLOCATION, OF_RELOCATION = "tails", "allocation", "relocation"
ANALYZED = (*ALLOCATION, *CONTRIBUTIONS, *RELOCATION, *SENSITIVITIES, *TAILS, *WORST_CASE)
