"""Tests of the insides of `features`."""
