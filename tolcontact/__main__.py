"""`python -m tolcontact`, and the console script: the command line, which may be stopped while it is being imported."""

import tolcontact
from tolcontact import interrupts


def command_line() -> None:
    """Run the command line (see tolcontact.cli)."""
    try:
        with interrupts.stoppable():
            tolcontact.command_line()  # imported here, on first use
    except KeyboardInterrupt:
        interrupts.end("stopped before anything was done")


if __name__ == "__main__":
    command_line()
