"""Tests of the insides of `variation`."""
