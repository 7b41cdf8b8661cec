"""Summarize: statistics of measures with their intervals, and displacement fields."""

from tolcontact.statistics.fields import BlockSums, DisplacementFields
from tolcontact.statistics.summary import summarize

__all__ = ["BlockSums", "DisplacementFields", "summarize"]
