"""`python -m tolcontact`, and the console script: the command line, which may be stopped while it is being imported."""

import tolcontact
from tolcontact import interrupts


def command_line() -> None:
    """Run the command line (see tolcontact.cli)."""
    with interrupts.stoppable(at_once="stopped before anything was done"):
        tolcontact.command_line()  # imported here, on first use


if __name__ == "__main__":
    command_line()
