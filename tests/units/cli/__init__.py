"""Tests of the insides of `cli`."""
