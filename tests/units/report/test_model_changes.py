"""Changes of a model by the documents in two archives."""

from tolcontact.report.comparison_text import model_changes


def test_changes_are_by_name_and_moved_lines_do_not_count():
    assert list(model_changes({"a": [{"name": "x", "declared_at": "1"}]}, {"a": [{"name": "x", "declared_at": "2"}]})) == []
    before = {"parts": [{"name": "p", "at": [0, 0]}, {"name": "q"}], "mu": 0.1}
    after = {"parts": [{"name": "q"}, {"name": "p", "at": [0, 1]}, {"name": "q"}], "mu": None}
    assert list(model_changes(before, after)) == [
        "parts, p, at: [0, 0], now [0, 1]",
        "parts, q 3: added (q)",
        "mu: 0.1, now null",
    ]
    assert list(model_changes({"lower": -0.009}, {"lower": -0.0074 - 2e-18})) == ["lower: -0.009, now -0.0074"]
