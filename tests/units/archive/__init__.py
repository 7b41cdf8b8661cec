"""Tests of the insides of `archive`."""
