"""The HTML of assemblies, programs, summaries and results in a notebook: tables, and a 3D scene."""

import functools
import html

import xarray as xr

from tolcontact.compilation import Program
from tolcontact.declaration import Assembly
from tolcontact.report.contact_text import contact_lines
from tolcontact.report.html.page import nominal_and_faults, page_of, summary_table, view_page
from tolcontact.statistics import Summary

HEIGHT = 640  # pixels of a scene
_DIMENSIONS = {"measure", "state", "statistic", "change_of", "interval", "pair", "status_meaning", "of_iterations"}


@functools.singledispatch
def html_of(thing: object) -> str:
    """Return an object as HTML."""
    return f"<pre>{html.escape(str(thing))}</pre>"


@html_of.register
def _(model: Assembly) -> str:
    return _declared(model) + framed(view_page(model, *nominal_and_faults(model)))


@html_of.register
def _(program: Program) -> str:
    nominal = program.nominal
    return _declared(program) + framed(view_page(nominal.assembly, nominal, ()))


@html_of.register
def _(summary: Summary) -> str:
    if not _DIMENSIONS <= {*summary.dims}:  # a selection of it
        return str(xr.Dataset._repr_html_(summary))
    lines = "".join(f"<li>{html.escape(line)}</li>" for line in contact_lines(summary, summary.attrs["realizations"]))
    return f"{summary_table(summary)}<ul>{lines}</ul>"


def results_html(results: xr.DataTree, summary: Summary) -> str:
    """Return the report of results, after an overview that also appears where scripts are not run."""
    return summary_table(summary) + framed(page_of(results, summary))


def framed(page: str) -> str:
    """Return a page inside a frame, whose scripts cannot see the notebook."""
    return (
        f'<iframe srcdoc="{html.escape(page)}" sandbox="allow-scripts" title="assembly" '
        f'style="width: 100%; height: {HEIGHT}px; border: 1px solid #c9ced6"></iframe>'
    )


def _declared(thing: object) -> str:
    return (
        f"<details><summary>{html.escape(str(thing).splitlines()[0])}</summary><pre>{html.escape(str(thing))}</pre></details>"
    )
