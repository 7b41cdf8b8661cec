"""Tests of the insides of `geometry`."""
