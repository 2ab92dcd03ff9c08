"""The cards of the weights and of simulated sets agree with the weights, a set, and the pages of results."""

import re
from itertools import pairwise
from pathlib import Path

import pytest

from echoscape.learn.model.weights import load_weights, shipped_weights
from echoscape.sim.datasets.polar_scan import Component
from tests.learn.simulated import write_simulated
from tests.paths import ROOT

DOCS = ROOT / "docs"
MODEL, DATA = (DOCS / "model_card.md").read_text(), (DOCS / "data_card.md").read_text()
RESULTS, FIDELITY = (DOCS / "results.md").read_text(), (DOCS / "fidelity.md").read_text()
MODEL_HEADINGS = [  # Mitchell et al. 2019, figure 1
    *("Model details", "Intended use", "Factors", "Metrics", "Evaluation data", "Training data"),
    *("Quantitative analyses", "Ethical considerations", "Caveats and recommendations"),
]
DATA_HEADINGS = [  # Gebru et al. 2021, section 3
    *("Motivation", "Composition", "Collection process", "Preprocessing and labelling", "Uses"),
    *("Distribution", "Maintenance"),
]


def sections(page: str) -> dict[str, str]:
    """Return the text below each heading."""
    parts = re.split(r"^## (.*)$", page, flags=re.MULTILINE)[1:]
    return dict(zip(parts[::2], parts[1::2], strict=True))


def rows(text: str) -> list[list[str]]:
    """Return the cells of the tables of a text, without heads."""
    lines = [line.strip() for line in text.splitlines()]
    heads = {before for before, line in pairwise(lines) if re.fullmatch(r"\|[-:|]+\|", line)}
    body = [line for line in lines if line.startswith("|") and line not in heads]
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in body
        if not re.fullmatch(r"[-:| ]+", line)
    ]


def test_cards_have_the_headings_of_their_sources() -> None:
    assert list(sections(MODEL)) == MODEL_HEADINGS
    assert [each for each in sections(DATA) if each in DATA_HEADINGS] == DATA_HEADINGS


@pytest.mark.parametrize(("pixel_m", "path"), shipped_weights().items())
def test_the_model_card_describes_each_file_of_weights(pixel_m: float, path: Path) -> None:
    model, record = load_weights(path)
    described = {row[0]: row[1:] for row in rows(sections(MODEL)["Model details"])}
    pixel, trained, used, parameters, size = described[f"`{path.name}`"]
    image = model.settings.image
    assert pixel == f"{pixel_m} m"
    assert trained.endswith(f"{image.size} px")
    assert used == f"{image.size} px, {image.size * image.pixel_m:.0f} m a side"
    assert parameters == f"{sum(each.numel() for each in model.parameters()):,}"
    assert size == f"{path.stat().st_size / 1e6:.1f} MB"
    assert set(record["validation"]) == {"val_town_1001", "val_suburb_1002", "val_industrial_1003"}


def test_the_training_data_are_those_of_the_records() -> None:
    _, record = load_weights(shipped_weights()[0.6912])
    seeds = [int(name.rpartition("_")[2]) for name in record["data"]]
    text = sections(MODEL)["Training data"]
    assert "Thirty simulated sets" in text
    assert len(seeds) == 30
    for first in (2001, 2101, 2201):
        assert f"{first} to {first + 9}" in text
        assert [each for each in sorted(seeds) if first <= each < first + 10] == [*range(first, first + 10)]


def test_figures_of_the_model_card_are_those_of_the_results() -> None:
    known = rows(RESULTS)
    figures = rows(sections(MODEL)["Quantitative analyses"])
    assert len(figures) == 10
    assert [row for row in figures if row not in known] == []


def test_figures_of_the_data_card_are_those_of_the_fidelity_page() -> None:
    text = sections(DATA)["Known differences from real scans"]
    towns = [row for row in rows(text) if row[0].startswith("town_")]
    known = {row[0]: row[1:] for row in rows(FIDELITY)}
    assert [known[row[0].split(",")[0]][0] for row in towns] == [f"{row[1]} of 95" for row in towns]
    statistics = [row for row in rows(text) if row not in towns]
    assert len(statistics) > 5
    assert [row for row in statistics if known[row[0]][:2] != row[1:]] == []


def test_the_data_card_lists_what_a_set_holds(tmp_path: Path) -> None:
    listed = set(re.findall(r"^\| (`.*?`) \|", sections(DATA)["Composition"], re.MULTILINE))
    names = {name.rstrip("/") for cell in listed for name in re.findall(r"`(.*?)`", cell)}
    found = {path.name for path in write_simulated(tmp_path / "set", scans=2).iterdir()}
    assert found <= names
    assert names - found == {"preview.png", "beat"}  # by the command line, and where it is asked for
    for component in Component:
        assert component.name.lower() in sections(DATA)["Composition"]
