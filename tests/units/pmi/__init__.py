"""Tests of the insides of `pmi`."""
