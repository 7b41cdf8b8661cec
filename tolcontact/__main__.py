"""`python -m tolcontact`, and the console script: the command line, which may be stopped while it is being imported."""

import os
import sys

import tolcontact


def command_line() -> None:
    """Run the command line (see tolcontact.cli)."""
    try:
        tolcontact.command_line()  # imported here, on first use
    except KeyboardInterrupt:
        sys.stderr.write("stopped before anything was done\n")
        sys.stderr.flush()
        os._exit(130)


if __name__ == "__main__":
    command_line()
