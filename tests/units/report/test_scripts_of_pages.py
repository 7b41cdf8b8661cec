"""The scripts of pages, as each page has them, are linted like the rest."""

import json
import subprocess
from pathlib import Path

import pytest

from tolcontact.report.html.page import HERE, SCRIPTS

RULES = {
    "env": {"browser": True, "es2022": True},
    "globals": {"THREE": "readonly", "Plotly": "readonly"},
    "categories": {"correctness": "error", "suspicious": "error"},
    "rules": {
        "no-undef": "error",
        "no-var": "error",
        "prefer-const": "error",
        "eqeqeq": "error",
        "no-unused-vars": ["error", {"varsIgnorePattern": "^(figure|unpacked|COLOURS)$"}],  # shared; a page need not use them
        "no-shadow": "off",
        "unicorn/consistent-function-scoping": "off",
    },
}


@pytest.mark.parametrize("page", SCRIPTS)
def test_no_complaint(page, tmp_path):
    own = [HERE / file for file in SCRIPTS[page] if "vendor" not in file]
    whole = "\n".join(file.read_text(encoding="utf-8").removeprefix('"use strict";') for file in own)
    (tmp_path / "page.js").write_text(f'"use strict";\n{whole}', encoding="utf-8")
    (tmp_path / "rules.json").write_text(json.dumps(RULES))
    said = subprocess.run(
        ["oxlint", "--config", "rules.json", "page.js"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert said.returncode == 0, said.stdout
    assert max(len(line) for file in own for line in file.read_text(encoding="utf-8").splitlines()) <= 168
    assert all(Path(HERE / file).is_file() for file in SCRIPTS[page])
