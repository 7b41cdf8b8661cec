"""Tests of the insides of `compilation`."""
