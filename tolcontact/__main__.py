"""`python -m tolcontact`, and the console script: the command line, which may be stopped while it is being imported."""

import sys

import tolcontact
from tolcontact import interrupts


def command_line() -> None:
    """Run the command line (see tolcontact.cli)."""
    with interrupts.stoppable(at_once="stopped"):
        try:
            run = tolcontact.command_line  # imported here, on first use
        except (ImportError, MemoryError) as error:
            sys.stderr.write(f"error: libraries cannot be loaded ({error}); is there enough memory, are all installed?\n")
            sys.exit(2)
        run()


if __name__ == "__main__":
    command_line()
