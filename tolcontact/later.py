"""Functions of later rooms that earlier ones offer: the front of the package registers them, so that no import goes back."""

from collections.abc import Callable
from typing import Any

HTML = "text/html"  # returns an object as HTML for a notebook
PMI = "features from PMI"  # declares features of a part
FASTENER = "fastener"  # declares what a fastener in holes consists of
LATER: dict[str, Callable[..., Any]] = {}
