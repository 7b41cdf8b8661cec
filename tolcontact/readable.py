"""Base classes for objects that print as readable rows in a console, and show pictures in a notebook."""

import html

from tolcontact.later import HTML, LATER


class Readable:
    """An object whose representation is its `str`."""

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"


class Pictured(Readable):
    """An object that a notebook shows as a picture."""

    def _repr_html_(self) -> str:
        return str(LATER[HTML](self))
