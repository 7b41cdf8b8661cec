"""The report: one page that holds everything, made from an archive alone, and needs no network."""

from tolcontact.report.html.page import write_page

__all__ = ["write_page"]
