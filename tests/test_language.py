"""The language of the code: names are nouns, docstrings open with a verb or a noun."""

import ast
import re
from collections import defaultdict

import pytest

from tests.sources import FILES, PACKAGE, tree

BARE = re.compile(
    "own|of|found|each|every|some|said|one|both|here|there|known|left|more|others?|what|whose|these|rest|far|near|now|then|so|all|"
    "told|asked|given|made|apart|beside|below|above|away|off|whole|same|again|anew|before|after|first|second|theirs|words?|who|"
    "why|how|too|less|least|most|many|few|wanted|seen|held|kept|taken|shown|chosen|drawn|tried"
)  # function words and participles: they do not say what a value is
OPENINGS = re.compile("what|which|how|whether|of|those|that|where|whose|some|its?|as")
MAX_BARE, MAX_BARE_IN_A_ROOM, MAX_OPENINGS = 0.02, 0.04, 0.02


def bindings(source: ast.AST) -> list[str]:
    stored = [node.id for node in ast.walk(source) if isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store)]
    return stored + [node.arg for node in ast.walk(source) if isinstance(node, ast.arg)]


def openings(source: ast.AST) -> list[str]:
    functions = [node for node in ast.walk(source) if isinstance(node, ast.FunctionDef)]
    docstrings = [(ast.get_docstring(function) or "").strip() for function in functions]
    return [re.split(r"\W", text)[0].lower() for text in docstrings if text]


def test_names_say_what_a_value_is():
    rooms = defaultdict(list)
    for file in FILES:
        rooms[file.relative_to(PACKAGE).parts[0]] += bindings(tree(file))
    names = [name for room in rooms.values() for name in room]
    bare = [name for name in names if BARE.fullmatch(name)]
    assert len(bare) <= MAX_BARE * len(names), f"{len(bare)} of {len(names)}: {sorted(set(bare))}"
    for room, bound in rooms.items():
        bare = [name for name in bound if BARE.fullmatch(name)]
        assert len(bare) <= max(2, MAX_BARE_IN_A_ROOM * len(bound)), f"{room}: {sorted(bare)}"


def test_docstrings_of_functions_open_with_a_verb():
    words = [word for file in FILES for word in openings(tree(file))]
    relative = [word for word in words if OPENINGS.fullmatch(word)]
    assert len(relative) <= MAX_OPENINGS * len(words), f"{len(relative)} of {len(words)}: {sorted(relative)}"


@pytest.mark.parametrize("limit, size", [("file", 350), ("function", 60)])
def test_files_and_functions_can_be_seen_whole(limit, size):
    for file in FILES:
        functions = [node for node in ast.walk(tree(file)) if isinstance(node, ast.FunctionDef)]
        spans = [(function.name, (function.end_lineno or 0) - function.lineno + 1) for function in functions]
        sizes = spans if limit == "function" else [("the file", len(file.read_text(encoding="utf-8").splitlines()))]
        for name, lines in sizes:
            assert lines <= size, f"{file.relative_to(PACKAGE)}: {name} has {lines} lines"
