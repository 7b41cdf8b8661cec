"""Everything that differs between operating systems. No other package asks which system this is, or uses what only POSIX has.

`files.IS_POSIX` tells the two kinds of systems apart; every module here offers the same functions on both.
"""
