"""Report: what people look at."""

from tolcontact.report.terminal import summary_text

__all__ = ["summary_text"]
