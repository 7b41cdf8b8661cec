"""Tests of the insides of `contact`."""
