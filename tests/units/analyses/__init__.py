"""Tests of the insides of `analyses`."""
