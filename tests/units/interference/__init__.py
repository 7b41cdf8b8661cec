"""Tests of the insides of `interference`."""
