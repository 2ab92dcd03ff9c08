"""Cells of tables: what does not differ is 0 for any number of drives, and failed pairs have a share."""

from dataclasses import replace

import pytest

from echoscape.eval.ablation.study.tables import ablation_rows, difference_text, failed_text
from tests.eval.ablation.study.studies import made_up, small_study

STUDY = small_study("ghosts=4,0,2", "gain_step=-10", seeds=tuple(range(8)))


def test_what_rounds_to_nothing_has_no_minus() -> None:
    row = ablation_rows(STUDY, made_up(STUDY, cost_m={}))[-1]
    metric = replace(row.metric, digits=3)
    compared = replace(row.compared, difference=-4e-4, low=-0.2, high=4e-4)
    assert difference_text(replace(row, metric=metric, compared=compared)) == "+0.000 (-0.200 to +0.000)"


@pytest.mark.parametrize("drives", [1, 2, 8])
def test_no_difference_at_all_is_written_alike_for_any_number_of_drives(drives: int) -> None:
    study = small_study("ghosts=0", seeds=tuple(range(drives)))
    results = made_up(study, cost_m={})
    equal = {key: results[key[0], "default", key[2]] for key in results}
    assert {difference_text(row) for row in ablation_rows(study, equal)} == {"0"}
    apart = [row for row in ablation_rows(study, results) if row.condition.levels]
    assert "0" not in {difference_text(row) for row in apart if row.metric.name != "failed_pairs"}


def test_failed_pairs_have_a_share() -> None:
    study = small_study("ghosts=0", seeds=(1, 2))
    default, ghosts = (
        row
        for row in ablation_rows(study, made_up(study, cost_m={}, failed={"ghosts=0": 2}))
        if row.metric.name == "failed_pairs"
    )
    assert (failed_text(default), failed_text(ghosts)) == ("0 of 6", "4 of 6 (66.7 %)")
    assert ghosts.compared.difference == pytest.approx(200 / 3)
