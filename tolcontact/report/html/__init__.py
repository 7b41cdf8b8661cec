"""Pages for a browser that hold everything and need no network: the report of a run, runs side by side, and the view of a
model before any."""

from tolcontact.report.html.page import write_comparison, write_page, write_view

__all__ = ["write_comparison", "write_page", "write_view"]
