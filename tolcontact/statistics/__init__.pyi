from .contact import TouchingShares as TouchingShares
from .fields import BlockSums as BlockSums, DisplacementFields as DisplacementFields
from .measure_statistics import STATISTICS as STATISTICS, limits as limits
from .run_comparison import compare_runs as compare_runs
from .summary import estimate_of as estimate_of
from .summary_dataset import Summary as Summary, summarize as summarize
from .touching_points import touching as touching
