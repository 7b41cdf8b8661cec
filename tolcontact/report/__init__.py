"""Report: what people look at."""

from tolcontact.report.text import comparison_text, grouped, summary_text

__all__ = ["comparison_text", "grouped", "summary_text"]
