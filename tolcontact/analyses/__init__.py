"""Ask: what matters, what is rare, and which ranges and places suffice."""

from tolcontact.analyses.allocate import allocate
from tolcontact.analyses.contributions import contributions
from tolcontact.analyses.relocate import relocate
from tolcontact.analyses.sensitivities import sensitivities
from tolcontact.analyses.tails import tails
from tolcontact.analyses.worst_case import worst_case

__all__ = ["allocate", "contributions", "relocate", "sensitivities", "tails", "worst_case"]
