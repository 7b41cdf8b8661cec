"""Everything that differs between operating systems. No other package asks which system this is, or uses what only POSIX has.

`kind` tells the two kinds of systems apart; every other module here offers the same functions on both.
"""
