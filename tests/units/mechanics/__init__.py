"""Tests of the insides of `mechanics`."""
