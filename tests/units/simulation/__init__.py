"""Tests of the insides of `simulation`."""
