"""Base classes for objects that print as readable rows in a console, and show pictures in a notebook."""

import html
from importlib import import_module


class Readable:
    """An object whose representation is its `str`."""

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"


class Pictured(Readable):
    """An object that a notebook shows as a picture."""

    def _repr_html_(self) -> str:
        return picture(self)


def picture(thing: object) -> str:
    """Return an object as the HTML that a notebook shows; the report, a later room, is imported when one first does."""
    return str(import_module("tolcontact.report.notebook").html_of(thing))
