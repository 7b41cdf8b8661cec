"""Tests of the insides of rooms, which may go when a room is rebuilt."""
