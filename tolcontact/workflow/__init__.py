"""The whole flow in one call: run a model into an archive, compare solvers on it."""

from tolcontact.workflow.compare import compare
from tolcontact.workflow.run import build, check, run, summarize

__all__ = ["build", "check", "compare", "run", "summarize"]
