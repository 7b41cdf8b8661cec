"""Self-contained pages for a browser: the report of a run, the comparison of runs, and the view of a model."""

from tolcontact.report.html.page import summary_table, write_page

__all__ = ["summary_table", "write_page"]
