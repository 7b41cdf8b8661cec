"""Base classes for objects that print as readable rows in a console, and show pictures in a notebook."""

import html
from collections.abc import Callable
from typing import Any, ClassVar


class Readable:
    """An object whose representation is its `str`."""

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"


class Pictured(Readable):
    """An object that a notebook shows as a picture: as the HTML of `picture`, which the front of the package sets.

    The report makes the picture, in a later room that none of these objects may import.
    """

    picture: ClassVar[Callable[[Any], str]]

    def _repr_html_(self) -> str:
        return type(self).picture(self)
