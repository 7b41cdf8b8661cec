"""Things that show themselves: as readable rows in a console, and as pictures in a notebook."""

import html
import importlib


class Readable:
    """Shows its `str`."""

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"


class Pictured(Readable):
    """Shows its `picture_of` in a notebook."""

    def _repr_html_(self) -> str:
        return picture_of(self)


def picture_of(thing: object) -> str:
    """What `tolcontact.report.notebook` makes of a thing, as HTML.

    That stands after everything that is shown, so it is looked up by its name, and only when a notebook asks.
    """
    return str(importlib.import_module("tolcontact.report.notebook").html_of(thing))
