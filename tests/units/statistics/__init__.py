"""Tests of the insides of `statistics`."""
