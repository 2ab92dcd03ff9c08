"""What the site must not miss: public names, commands, the version. `make docs` checks links and pages."""

import re
from importlib import import_module, metadata
from pathlib import Path

import pytest

from echoscape.cli.__main__ import COMMANDS
from tests.paths import ROOT

REFERENCE = ROOT / "docs" / "reference"
PACKAGES = ("scenes", "sim", "learn", "eval", "testing")
TUTORIALS = sorted((ROOT / "docs" / "tutorials").glob("*.md"))
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").glob("*.md"), *TUTORIALS, *REFERENCE.glob("*.md")])


def test_the_root_page_documents_every_name_of_the_root() -> None:
    page = (REFERENCE / "echoscape.md").read_text()
    documented = set(re.findall(r"\.\. auto(?:class|function):: (\w+)$", page, re.MULTILINE))
    assert documented == set(import_module("echoscape").__all__) - {"__version__"}


@pytest.mark.parametrize("package", PACKAGES)
def test_the_page_of_a_package_leaves_out_only_what_is_documented_elsewhere(package: str) -> None:
    page = (REFERENCE / f"{package}.md").read_text()
    assert f".. automodule:: echoscape.{package}\n" in page  # which documents all other classes and functions
    left_out = set(re.findall(r":exclude-members: (.*)", page + ":exclude-members: ")[0].split(", ")) - {""}
    by_hand = set(re.findall(r"\.\. py:data:: (\w+)$", page, re.MULTILINE))
    assert left_out <= set(import_module("echoscape").__all__) | by_hand
    module = import_module(f"echoscape.{package}")
    assert left_out <= set(module.__all__)
    assert by_hand == {name for name in module.__all__ if not callable(getattr(module, name))}


def test_every_command_shows_its_options() -> None:
    page = (REFERENCE / "commands.md").read_text()
    assert re.findall(r"^## echoscape (\w+)$", page, re.MULTILINE) == list(COMMANDS)
    assert re.findall(r"^```\{program-output\} echoscape (\w+) --help$", page, re.MULTILINE) == list(COMMANDS)


def test_the_citation_has_the_version_of_the_package() -> None:
    (version,) = re.findall(r"^version: (.*)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE)
    assert version == metadata.version("echoscape")


def test_the_citation_has_a_date_once_the_version_is_released() -> None:
    released = "0.1.0 (unreleased)" not in (ROOT / "CHANGELOG.md").read_text()
    assert ("date-released:" in (ROOT / "CITATION.cff").read_text()) == released


@pytest.mark.parametrize("tutorial", TUTORIALS, ids=lambda path: path.stem)
def test_the_front_page_leads_to_every_tutorial(tutorial: Path) -> None:
    assert f"](tutorials/{tutorial.name})" in (ROOT / "docs" / "index.md").read_text()


@pytest.mark.parametrize("page", PAGES, ids=lambda path: str(path.relative_to(ROOT)))
def test_links_lead_to_files_in_a_repository_browser_too(page: Path) -> None:
    prose = re.sub(r"^```.*?^```$", "", page.read_text(), flags=re.MULTILINE | re.DOTALL)
    links = re.findall(r"\]\((?!https?:|#)([^)#\s]+)", prose)
    assert [link for link in links if not (page.parent / link).exists()] == []
