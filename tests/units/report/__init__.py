"""Tests of the insides of `report`."""
