"""Pages for a browser that hold everything and need no network: the report of a run, runs side by side, and the view of a
model before any."""

from tolcontact.report.html.page import page_of, summary_table, view_page, write_comparison, write_page, write_view

__all__ = ["page_of", "summary_table", "view_page", "write_comparison", "write_page", "write_view"]
