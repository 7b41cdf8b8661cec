"""Tests of the insides of `workflow`."""
