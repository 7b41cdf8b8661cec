"""Results as text for a terminal, or a pipe."""

from tolcontact.report.text.comparison import comparison_text
from tolcontact.report.text.population import population_text
from tolcontact.report.text.summary import summary_text

__all__ = ["comparison_text", "population_text", "summary_text"]
