"""Tests of the insides of `testing`."""
