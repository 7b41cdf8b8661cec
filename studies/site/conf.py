"""Settings of Sphinx for the site, and how it writes equations and docstrings."""

import re

from docutils import nodes
from docutils.utils.math.latex2mathml import tex2mathml

import tolcontact as tc

project, author, release = "tolcontact", "The tolcontact developers", tc.__version__
copyright = author
extensions = ["myst_parser", "sphinx.ext.autodoc"]
myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3
html_theme = "furo"  # its side bar lists all pages, in one hierarchy; others list those of a section
html_title = f"tolcontact {release}"
html_static_path, html_css_files = ["_static"], ["site.css"]
html_show_sourcelink = html_copy_source = False
html_math_renderer = "mathml"
suppress_warnings = ["misc.highlighting_failure", "myst.header"]
pygments_style = "default"
autodoc_member_order, autodoc_typehints = "groupwise", "description"
autodoc_typehints_description_target = "documented"
add_module_names = False
default_role = "code"


# docutils writes the index of a letter with a bar below the letter.
UNDER_BAR = re.compile(r'<munderover>\s*(<mi>.</mi>)\s*(<mi>.</mi>)\s*(<mo stretchy="false">ˉ</mo>)\s*</munderover>')
BAR_WITH_INDEX = r'<msub><mover accent="true">\1\3</mover>\2</msub>'


def _equation(visitor, node):  # MathML needs no script, and nothing is fetched
    is_block = isinstance(node, nodes.math_block)
    mathml = UNDER_BAR.sub(BAR_WITH_INDEX, tex2mathml(node.astext(), as_block=is_block)).replace("ˉ", "¯")
    visitor.body.append(f'<div class="equation">{mathml}</div>' if is_block else mathml)
    raise nodes.SkipNode


def _as_text(app, what, name, thing, options, lines):
    """Turn a docstring, which is plain text, into reStructuredText: what is aligned or indented stays as it is."""
    paragraphs = re.split(r"\n\s*\n", "\n".join(lines))
    result = []
    for paragraph in paragraphs:
        rows = paragraph.splitlines()
        is_aligned = any(row.startswith(" ") for row in rows) or any(re.search(r"\S {2,}\S", row) for row in rows)
        is_example = paragraph.lstrip().startswith(">>>")
        if is_aligned or is_example:
            result += [f".. code-block:: {'pycon' if is_example else 'text'}", "", *("    " + row for row in rows), ""]
        else:
            result += [*(re.sub(r"`([^`]*)`", r"``\1``", re.sub(r"(?<!`)([*|_])(?=\W|\b)", r"\\\1", row)) for row in rows), ""]
    lines[:] = result


def _is_left_out(app, what, name, thing, is_skipped, options):
    """Leave out the methods that no script calls, whose docstrings have no example."""
    return is_skipped or (callable(thing) and not re.search(r"`[^`]*\w\(|>>> ", thing.__doc__ or "")) or None


def setup(app):
    app.add_html_math_renderer("mathml", inline_renderers=(_equation, None), block_renderers=(_equation, None))
    app.connect("autodoc-process-docstring", _as_text)
    app.connect("autodoc-skip-member", _is_left_out)
