"""Summarize: statistics of measures with their intervals, and displacement fields."""

from tolcontact.statistics.fields import FieldMoments
from tolcontact.statistics.summary import finished, summarize

__all__ = ["FieldMoments", "finished", "summarize"]
