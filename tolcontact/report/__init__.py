"""Report: what people look at."""

from tolcontact.report.comparison import comparison_text
from tolcontact.report.terminal import grouped, summary_text

__all__ = ["comparison_text", "grouped", "summary_text"]
