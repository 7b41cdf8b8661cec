"""Results as text for a terminal, or a pipe."""

from tolcontact.report.text.allocation import allocation_text
from tolcontact.report.text.comparison import comparison_text
from tolcontact.report.text.contributions import contributions_text
from tolcontact.report.text.population import population_text
from tolcontact.report.text.relocation import relocation_text
from tolcontact.report.text.runs import runs_text
from tolcontact.report.text.sensitivities import sensitivities_text
from tolcontact.report.text.summary import capability_text, summary_text
from tolcontact.report.text.tails import tails_text
from tolcontact.report.text.worst_case import worst_case_text

__all__ = [
    "allocation_text", "capability_text", "comparison_text", "contributions_text", "population_text", "relocation_text",
    "runs_text", "sensitivities_text", "summary_text", "tails_text", "worst_case_text",
]  # fmt: skip
