"""Signals that stop a command."""

import signal

# Ctrl-C, an order to end, and Ctrl-Break of Windows, which never delivers the order.
STOPPING = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGBREAK") if hasattr(signal, name))
