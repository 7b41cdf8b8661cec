from .accessor import summarize as summarize
from .comparison import compare as compare, compare_runs as compare_runs
from .lazy_runs import simulate as simulate
from .models import build as build, check as check, write_model as write_model
from .runs import open_archive as open_archive, run as run
