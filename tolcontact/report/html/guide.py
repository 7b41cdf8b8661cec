"""The installed guide as pages for a browser."""

import re
import shutil
from pathlib import Path

from markdown_it import MarkdownIt

HERE = Path(__file__).parent
GUIDE = Path(__file__).parents[2] / "guide"
FRONT = "index"
STYLE = """
main { max-width: 60rem; padding-bottom: 3rem; }
img { max-width: 100%; background: white; }
table { min-width: 0; }
pre, main > table { display: block; overflow-x: auto; }
pre { background: var(--panel); padding: 8px; }
a { color: var(--accent); }
"""


def write_guide(folder: Path) -> Path:
    """Write the pages into a folder, and return the path of the front. Equations stay in the notation of TeX."""
    renderer = MarkdownIt("commonmark").enable("table")
    style = (HERE / "page.css").read_text(encoding="utf-8") + STYLE
    shutil.copytree(GUIDE, folder, dirs_exist_ok=True, ignore=shutil.ignore_patterns("*.md"))
    for source in GUIDE.rglob("*.md"):
        page = folder / source.relative_to(GUIDE).with_suffix(".html")
        page.parent.mkdir(parents=True, exist_ok=True)
        body = re.sub(r'(href="[^":]*)\.md', r"\1.html", renderer.render(_with_code_for_equations(source)))
        front = f'<a href="{"../" * (len(page.relative_to(folder).parts) - 1)}{FRONT}.html">tolcontact</a>'
        page.write_text(
            f'<!doctype html><html lang="en"><meta charset="utf-8"><meta name="viewport" content="width=device-width">'
            f"<title>{source.stem}</title><style>{style}</style><main><p>{front}</p>{body}</main></html>",
            encoding="utf-8",
        )
    return folder / f"{FRONT}.html"


def _with_code_for_equations(source: Path) -> str:
    """Return the text of a chapter with equations as code, so that no character of them is taken for Markdown."""
    text = re.sub(r"^\$\$\n(.*?)\n\$\$$", r"```\n\1\n```", source.read_text(encoding="utf-8"), flags=re.MULTILINE | re.DOTALL)
    blocks = re.split(r"(^```.*?^```$)", text, flags=re.MULTILINE | re.DOTALL)
    return "".join(
        block if block.startswith("```") else re.sub(r"\$([^$\n]+(?:\n[^$\n]+)?)\$", r"`\1`", block) for block in blocks
    )
