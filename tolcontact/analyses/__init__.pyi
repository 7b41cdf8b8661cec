from .allocate import allocate as allocate
from .contributions import contributions as contributions
from .relocate import relocate as relocate
from .seating import seating as seating
from .sensitivities import sensitivities as sensitivities
from .stack_up import stack_up as stack_up
from .tails import tails as tails
from .worst_case import worst_case as worst_case
