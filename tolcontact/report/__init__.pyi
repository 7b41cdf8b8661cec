from .analysis_tables import analysis_text as analysis_text, brief_lines as brief_lines
from .comparison_text import comparison_text as comparison_text, runs_text as runs_text
from .html.guide import write_guide as write_guide
from .html.page import (
    is_page as is_page,
    nominal_and_faults as nominal_and_faults,
    write_comparison as write_comparison,
    write_page as write_page,
    write_view as write_view,
)
from .notebook import results_html as results_html
from .results_table import has_no_verdict as has_no_verdict
from .spreadsheet import write_spreadsheet as write_spreadsheet
from .summary_text import capability_text as capability_text, summary_text as summary_text
from .table import grouped as grouped
