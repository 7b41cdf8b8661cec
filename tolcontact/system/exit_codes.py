"""Exit codes of child processes that a signal or an exception of the system ended."""

import signal

TIME_LIMIT = -signal.SIGXCPU if hasattr(signal, "SIGXCPU") else None  # exit code of a child at the end of its processor time
WINDOWS_CRASH = 0xC0000000  # exit codes from here on are exceptions


def crash(code: int) -> str:
    """Return the signal or the exception that crashed a process with an exit code; "" if it did not."""
    if code < 0:
        name = f", {signal.Signals(-code).name}" if -code in set(signal.Signals) else ""
        return f"signal {-code}{name}"
    return f"exception {code:#x}" if code >= WINDOWS_CRASH else ""
