"""Self-contained pages for a browser: the report of a run, the comparison of runs, and the view of a model."""

from tolcontact.report.html.guide import write_guide
from tolcontact.report.html.page import (
    is_page,
    nominal_and_faults,
    page_of,
    summary_table,
    view_page,
    write_comparison,
    write_page,
    write_view,
)

__all__ = [
    "is_page", "nominal_and_faults", "page_of", "summary_table", "view_page", "write_comparison", "write_guide", "write_page",
    "write_view",
]  # fmt: skip
