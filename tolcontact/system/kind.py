"""The kind of operating system: POSIX (Linux, macOS), or Windows."""

import os

IS_POSIX = hasattr(os, "geteuid")  # users with numbers, links for everyone, open files that can be replaced and removed
