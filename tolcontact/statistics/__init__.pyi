from .contact import TouchingShares as TouchingShares, touching as touching
from .fields import BlockSums as BlockSums, DisplacementFields as DisplacementFields
from .measure_statistics import STATISTICS as STATISTICS, limits as limits
from .run_comparison import compare_runs as compare_runs
from .summary import Summary as Summary, estimate_of as estimate_of, summarize as summarize
