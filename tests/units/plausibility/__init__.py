"""Tests of the insides of `plausibility`."""
