"""Results as text for a terminal or a pipe."""

from tolcontact.report.text.runs import analysis_text, comparison_text, population_text, runs_text
from tolcontact.report.text.summary import capability_text, summary_text

__all__ = ["analysis_text", "capability_text", "comparison_text", "population_text", "runs_text", "summary_text"]
