"""Tests of the insides of `declaration`."""
