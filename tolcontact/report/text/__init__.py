"""Results as text for a terminal or a pipe."""

from tolcontact.report.text.analyses import analysis_text
from tolcontact.report.text.checks import comparison_text, population_text
from tolcontact.report.text.runs import runs_text
from tolcontact.report.text.summary import capability_text, summary_text

__all__ = ["analysis_text", "capability_text", "comparison_text", "population_text", "runs_text", "summary_text"]
