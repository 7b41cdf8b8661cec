"""Shares of contributors by nominal sensitivities, for runs with too few realizations."""

import numpy as np

import tolcontact as tc
from tests import cases
from tests.helpers import call
from tolcontact.analyses.rebuilt import first_order_variances
from tolcontact.report.contributor_shares import shares_or_first_order


def test_they_are_those_of_a_regression_without_contact(tmp_path):
    tc.run(cases.ra1(), samples=12, solver="daqp", out=tmp_path / "few.nc").close()
    with tc.open_archive(tmp_path / "few.nc") as few, tc.run(cases.ra1(), samples=400, solver="daqp") as many:
        (shown,) = shares_or_first_order(few, 12, lambda: first_order_variances(few))
        x, y = many["sample"].deviation.values, many.measured.sel(state="raw").values[:, 0]
        slopes = np.linalg.lstsq(np.column_stack([x, np.ones(len(x))]), y, rcond=None)[0][:-1]
        variances = (slopes * x.std(axis=0)) ** 2
        labels = many["sample"]["contributor"].values
    expected = dict(zip(map(str, labels), variances / variances.sum(), strict=True))
    found = dict(zip(shown.groups, shown.shares[:, 0], strict=True))
    assert found.keys() <= expected.keys() and len(found) == 3
    assert max(abs(found[name] - expected[name]) / expected[name] for name in found if expected[name] > 0.01) < 0.3
    assert abs(sum(found.values()) - 1) < 1e-12 and np.isnan(shown.shares[:, 1:]).all()
    assert "first order, without contact" in shown.title and "12 realizations" in shown.note


def test_the_report_shows_them_with_their_name(tmp_path):
    tc.run(cases.ra1(), samples=12, solver="daqp", out=tmp_path / "few.nc").close()
    assert call(tmp_path, "report", "few.nc").returncode == 0
    page = (tmp_path / "few.html").read_text()
    assert "These are first-order shares, by sensitivities of the nominal assembly, without contact." in page
    assert "Contributors, first order, without contact" in page


def test_there_are_none_where_linear_shares_would_mislead_or_contributors_are_correlated(tmp_path):
    correlated = cases.ra1()
    correlated.correlate(["top.A1", "top.A2"], 0.5)
    for number, (model, samples) in enumerate([(cases.ra1(), 400), (correlated, 12)]):
        path = tmp_path / f"{number}.nc"
        tc.run(model, samples=samples, solver="daqp", out=path).close()
        with tc.open_archive(path) as run:
            assert all("first order" not in shares.title for shares in shares_or_first_order(run, samples, lambda: 1 / 0))
