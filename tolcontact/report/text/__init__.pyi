from .runs import (
    analysis_text as analysis_text,
    comparison_text as comparison_text,
    runs_text as runs_text,
)
from .summary import capability_text as capability_text, summary_text as summary_text
