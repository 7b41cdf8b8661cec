"""Elastic parts on the page of a run: arrows and the table of reactions, and the share of variance that elasticity adds."""

import json
import re

import numpy as np
import pytest

import tolcontact as tc
from tests.helpers import call
from tests.test_elastic_parts import B, H, L, supported_beam, tips
from tolcontact.analyses.rebuilt import rigid_values
from tolcontact.report.elastic_tables import elastic_tables, reactions_of

FEET = [f"beam.A{k}" for k in range(6)]


def rigid_beam():
    """The supported beam without bending, as a model of its own."""
    model = tc.Assembly("rigid", method=tc.Method(objective="seating"))
    part = model.part("beam", tc.Box(L, B, H))
    feet = [
        tc.Locator(f"A{k}", (x, y, 0), "z", one_sided=True)
        for k, (x, y) in enumerate((x, y) for x in (10, 200, 390) for y in (0, B))
    ]
    sides = [tc.Locator(f"B{k}", (x, 0, 0), "y") for k, x in enumerate((10, 390))]
    model.locate(part, [*feet, *sides, tc.Locator("C", (10, 20, 0), "x")], tolerance=0.6)
    model.force("press", at=part.point(200, 10, H), vector=(0, 0, -100))
    model.measure("middle", part.point(200, 0, 0), along="z", tolerance=1)
    return model


def data_of(page):
    return json.loads(re.search(r'<script[^>]*id="data"[^>]*>(.*?)</script>', page, re.DOTALL)[1])


def test_the_page_has_an_arrow_and_a_row_for_each_reaction_and_the_share_of_variance(tmp_path):
    tc.run(supported_beam(tmp_path, 100.0), samples=100, seed=1, out=tmp_path / "run.nc").close()
    tc.run(rigid_beam(), samples=100, seed=1, out=tmp_path / "rigid.nc").close()
    assert call(tmp_path, "report", "run.nc").returncode == 0
    with tc.open_archive(tmp_path / "run.nc") as run, tc.open_archive(tmp_path / "rigid.nc") as rigid:
        reactions = {reaction.name: reaction for reaction in reactions_of(run)}
        loads = run["elastic"].reaction_at_load.values
        forces, variances = elastic_tables(run, lambda: rigid_values(run))
        bent, stiff = (results.measured.sel(state="corrected").values[:, 0] for results in (run, rigid))
        assert list(elastic_tables(rigid, lambda: rigid_values(rigid))) == []
        assert rigid_values(run).measured[:, 0] == pytest.approx(stiff, abs=1e-6)
    assert list(reactions) == [*FEET, "beam.B0", "beam.B1", "beam.C"]
    assert sum(reactions[name].values for name in FEET) == pytest.approx(100.0, rel=1e-6)
    rows = {row[0]: row for row in forces.rows}
    assert sorted(rows) == sorted(reactions) and {row[0] for row in forces.rows[:6]} == set(FEET)  # the largest first
    assert float(rows["beam.A2"][3].split()[0]) == pytest.approx(loads[:, 2].mean(), abs=1)
    assert rows["beam.A2"][1:3] == ["200, 0, 0", "0, 0, 1"]
    assert float(rows["beam.A2"][7].split()[0]) == pytest.approx(100 * (loads[:, 2] < 1e-2).mean(), abs=1)
    assert rows["beam.C"][3:5] == ["0", "0"] and not rows["beam.C"][7]
    ((name, share),) = variances.rows
    assert name == "middle"
    assert float(share.split()[0]) == pytest.approx(100 * (1 - stiff.var() / bent.var()), abs=0.5 + 1e-6)
    lower, upper = map(float, re.search(r"\[(.*), (.*)\]", share).groups())
    assert lower < float(share.split()[0]) < upper
    page = (tmp_path / "run.html").read_text(encoding="utf-8")
    arrows = data_of(page)["scene"]["reactions"]
    assert [arrow["at"] for arrow in arrows] == [reaction.at.tolist() for reaction in reactions.values()]
    foot = arrows[2]
    assert (foot["pair"], foot["along"]) == ("supports of beam", [0.0, 0.0, 1.0])
    assert [foot[word] for word in ("mean", "low", "high")] == pytest.approx(
        [loads[:, 2].mean(), *np.percentile(loads[:, 2], (2.5, 97.5))]
    )
    assert page.count("<h3>Reactions of elastic parts</h3>") == page.count("<h3>Variance that elasticity adds</h3>") == 1
    assert 'id="reactions"' in page
    assert call(tmp_path, "report", "rigid.nc").returncode == 0
    page = (tmp_path / "rigid.html").read_text(encoding="utf-8")
    assert "<h3>Reactions of elastic parts" not in page and 'id="reactions"' not in page


def test_parts_that_no_rigid_ones_replace_are_compared_with_their_best_fit_and_the_table_says_so(tmp_path):
    with tc.run(tips(tmp_path), samples=60, seed=1, out=tmp_path / "tips.nc") as run:
        forces, variances = elastic_tables(run, lambda: rigid_values(run))
        guns = run["elastic"].reaction_at_load.values[:, [x.name == "guns of weld.tips" for x in reactions_of(run)]]
        raw, bent = (run.measured.sel(state=state, measure="left tip").values.var() for state in ("raw", "corrected"))
    shares = dict(variances.rows)
    assert float(shares["left tip"].split()[0]) == pytest.approx(100 * (1 - raw / bent), rel=0.02)
    assert 'since no rigid part fits what "weld.left.A1" and 12 more hold' in variances.remarks[0]
    row = next(row for row in forces.rows if row[0] == "guns of weld.tips")
    assert float(row[5]) == pytest.approx(guns.min(), rel=1e-3)
