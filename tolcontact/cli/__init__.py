"""The command line, one file for each command. Results on stdout, progress and errors on stderr.

Exit codes: 0 done; 1 ran, but more realizations failed than FAILED_SHARE; 2 bad input, one message, nothing written;
130 and 143 stopped by Ctrl-C and by a signal to terminate: what is finished is in the archive.
"""

from tolcontact.cli import check, compare, run, summary
from tolcontact.cli.app import command_line, main

__all__ = ["check", "command_line", "compare", "main", "run", "summary"]
