"""Notes of an ablation say what its tables show: marks and counts where they exist, cautions where due."""

import pytest

from echoscape.eval.ablation.study.markdown_table import table_markdown
from echoscape.eval.ablation.study.notes import cautions, chance_note, how_to_read
from echoscape.eval.ablation.study.report import report_page
from echoscape.eval.ablation.study.settings import AblationStudy
from echoscape.eval.ablation.study.tables import AblationRow, ablation_rows
from tests.eval.ablation.study.studies import made_up, small_study


def compared(study: AblationStudy, **made: dict[str, float]) -> list[AblationRow]:
    return ablation_rows(study, made_up(study, cost_m=made.get("cost_m", {})))


@pytest.mark.parametrize("drives", [1, 2, 5])
def test_few_drives_have_neither_marks_nor_counts_of_intervals(drives: int) -> None:
    """All differences are far from 0 here, so that the intervals of 2 drives or more leave it out."""
    study = small_study("ghosts=4", seeds=tuple(range(drives)))
    rows = compared(study, cost_m={"ghosts=4": 0.5})
    text, page = table_markdown(study, rows), report_page(study, rows, {})
    assert "**+" not in text
    assert 'class="clear"' not in page
    assert chance_note(rows) is None
    for written in (text, page):
        assert "leaves out 0" not in written
        assert "leave out 0" not in written
        assert "Caution" in written


def test_marks_are_counted_and_explained_with_six_drives() -> None:
    study = small_study("ghosts=4,0", seeds=tuple(range(6)))
    rows = compared(study, cost_m={"ghosts=4": 0.5})
    text, page = table_markdown(study, rows), report_page(study, rows, {})
    marked = text.count("**+")
    assert marked >= 4  # those of ghosts=4, by four metrics
    assert page.count('<td class="clear">') == marked
    assert f"{marked} of 8 intervals in these tables leave out 0" in page
    assert "some 0 of them" in page  # 5 % of 8
    assert "Bold: the interval, of 6 drives or more, leaves out 0." in text
    assert "Orange: the interval, of 6 drives or more, leaves out 0." in page
    assert "Caution" not in text + page


def test_one_in_twenty_is_clear_by_chance() -> None:
    study = small_study("ghosts=4,0,2", "gain_step=-10,3", seeds=tuple(range(8)))
    assert "of 20 intervals" in (note := chance_note(compared(study)) or "")
    assert "some 1 of them" in note


def test_metrics_that_few_drives_have_are_not_counted() -> None:
    """Drift is known of 3 drives of 8, so that its interval is never called clear."""
    study = small_study("ghosts=4", seeds=tuple(range(8)))
    results = made_up(study, cost_m={"ghosts=4": 0.5})
    for drive in study.drives[3:]:
        for condition in study.conditions:
            metrics = results[drive.name, condition.name, "fourier"]["metrics"]
            metrics["kitti_drift"] = dict.fromkeys(metrics["kitti_drift"])
    assert (chance_note(ablation_rows(study, results)) or "").startswith("2 of 2 intervals")


def test_drives_of_one_seed_are_named_where_faults_are_studied() -> None:
    def of_seeds(*words: str) -> list[str]:
        study = small_study(*words, seeds=(7, 8, 9, 10, 11, 12), worlds=("yard", "town"))
        return cautions(study, compared(study))

    faulty = of_seeds("dropped_scans=0.2")
    assert len(faulty) == 6
    assert faulty[0].startswith("yard_7 and town_7 have the same seed, 7, which alone decides the draws")
    assert of_seeds("ghosts=0") == []
    study = small_study("dropped_scans=0.2", seeds=tuple(range(6)))
    assert cautions(study, compared(study)) == []


def test_methods_that_fail_under_the_default_condition_are_named() -> None:
    study = small_study("ghosts=0", seeds=tuple(range(6)))

    def failing(condition: str) -> list[str]:
        return cautions(study, ablation_rows(study, made_up(study, cost_m={}, failed={condition: 3})))

    (said,) = failing("default")
    assert said.startswith("of the pairs of fourier, 18 of 18 (100 %) fail under the default condition")
    assert failing("ghosts=0") == []


def test_the_first_note_counts_drives_and_scans() -> None:
    assert how_to_read(small_study("ghosts=0"), mark="Bold").startswith("1 drive of 2 scans. ")
    assert how_to_read(small_study("ghosts=0", seeds=(1, 2)), mark="Bold").startswith("2 drives of 2 scans. ")
