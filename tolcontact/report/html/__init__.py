"""Pages for a browser that hold everything and need no network: the report of a run, and the view of a model before any."""

from tolcontact.report.html.page import write_page, write_view

__all__ = ["write_page", "write_view"]
