"""Things that print as readable rows, wherever a console or a notebook shows them."""

import html


class Readable:
    """Shows its `str`."""

    def __repr__(self) -> str:
        return str(self)

    def _repr_html_(self) -> str:
        return f"<pre>{html.escape(str(self))}</pre>"
