"""The documentation is true: generated pages, outputs shown, links, pictures, examples."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from collections import Counter
from pathlib import Path
from types import ModuleType

import pytest
import yaml

import bfi_cli
from bfi_cli.serialization import OLDEST_READ, SCHEMA

ROOT = Path(__file__).resolve().parents[1]
DOCS = ROOT / "docs"
PAGES = sorted([ROOT / "README.md", ROOT / "CHANGELOG.md", ROOT / "CONTRIBUTING.md", *DOCS.glob("*.md")])
EXAMPLES = sorted((DOCS / "examples").glob("*.py"))
LARGEST_PICTURE = 120_000  # bytes: a page with all of them loads in a second or two
LONGEST_EXAMPLE = 40  # lines: what fits on a screen
MOST_WORDS = 30_000  # written by hand in all pages: two hours of reading


def script(name: str) -> ModuleType:
    specification = importlib.util.spec_from_file_location(name, DOCS / f"{name}.py")
    assert specification
    assert specification.loader
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def generate() -> ModuleType:
    return script("generate")


def prose(page: Path) -> str:
    """Return a page without its blocks of code and its code in lines."""
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    return re.sub(r"`[^`\n]*`", "code", text)


def anchors(page: Path) -> set[str]:
    """Return the anchors that GitHub gives the headings of a page."""
    text = re.sub(r"^```.*?^```", "", page.read_text("utf-8"), flags=re.DOTALL | re.MULTILINE)
    seen: Counter[str] = Counter()
    found = set()
    for heading in re.findall(r"^#{1,6} (.+?)\s*$", text, flags=re.MULTILINE):
        slug = re.sub(r"[^\w\- ]", "", heading.lower()).replace(" ", "-")
        found.add(f"{slug}-{seen[slug]}" if seen[slug] else slug)
        seen[slug] += 1
    return found


def test_generated_pages_are_up_to_date(generate: ModuleType) -> None:
    stale = [path.name for path, text in generate.pages().items() if path.read_text("utf-8") != text]
    assert stale == [], "run python docs/generate.py"


def test_the_page_of_public_names_has_those_of_the_package() -> None:
    named = re.findall(r"^## (\w+)$", (DOCS / "api.md").read_text("utf-8"), re.MULTILINE)
    assert sorted(named) == sorted(set(bfi_cli.__all__) - {"__version__"})


@pytest.mark.slow
def test_the_guide_shows_what_its_commands_print(generate: ModuleType, tmp_path: Path) -> None:
    shown = (DOCS / "guide.md").read_text("utf-8")
    assert generate.guide_page(shown, tmp_path) == shown, "run python docs/generate.py"
    assert shown.count("```sh\n") >= 6


@pytest.mark.slow
def test_the_readme_shows_what_its_example_prints(generate: ModuleType, tmp_path: Path) -> None:
    shown = (ROOT / "README.md").read_text("utf-8")
    assert generate.readme_page(shown, tmp_path) == shown, "run python docs/generate.py"


@pytest.mark.parametrize(
    ("before", "after", "agree"),
    [
        ("bias 4.004 m/s", "bias 4.004 m/s", True),
        ("bias 4.004 m/s", "bias 4.006 m/s", True),
        ("bias 4.004 m/s", "bias 4.007 m/s", False),
        ("bias 4.004 m/s", "bias 4.0041 m/s", True),
        ("p = 6.9e-10", "p = 7.0e-10", True),
        ("p = 6.9e-10", "p = 9.9e-10", False),
        ("order 12", "order 15", False),
        ("bias 4.004 m/s", "drift 4.004 m/s", False),
        ("a   b", "a b", True),
        ("one 1", "one 1 two 2", False),
    ],
)
def test_outputs_agree_to_the_digits_shown(generate: ModuleType, before: str, after: str, agree: bool) -> None:
    assert generate.agrees(before, after) is agree


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_and_anchors_resolve(page: Path) -> None:
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", prose(page)):
        if "://" in target:
            continue
        path, _, anchor = target.partition("#")
        file = (page.parent / path).resolve() if path else page
        if not file.exists() or (anchor and anchor not in anchors(file)):
            broken.append(target)
    assert broken == []


def test_every_section_of_the_theory_that_a_docstring_cites_exists() -> None:
    numbers = set(re.findall(r"^#{2,3} (\d+(?:\.\d+)?)", (DOCS / "theory.md").read_text("utf-8"), re.MULTILINE))
    cited = {
        (path.name, number)
        for path in (ROOT / "bfi_cli").rglob("*.py")
        for number in re.findall(r"docs/theory\.md,\s+(?:section )?(\d+(?:\.\d+)?)", path.read_text("utf-8"))
    }
    assert {(name, number) for name, number in cited if number not in numbers} == set()
    assert {"3.2", "9.1", "16"} <= numbers


def test_every_picture_is_made_shown_and_small() -> None:
    pictures = {path.stem: path for path in (DOCS / "pictures").iterdir()}
    assert {name for _, figures in script("pictures").RUNS for name in figures} == set(pictures)
    shown = {name for page in PAGES for name in re.findall(r"\(pictures/(\w+)\.png\)", page.read_text("utf-8"))}
    assert shown == set(pictures)
    assert [name for name, path in pictures.items() if path.stat().st_size > LARGEST_PICTURE] == []


def test_a_new_run_on_sparsity_replaces_its_section_of_the_page_alone() -> None:
    page = (DOCS / "validation.md").read_text("utf-8")
    start, end = "<!-- made: sparsity -->", "<!-- end -->"
    content = {
        "verdict": "It helps.",
        "tables": [{"name": "rates", "rows": [["one point", "a rule", "98 %"], ["one point", "another", "3 %"]]}],
        "facts": [["a rule", "the first"], ["another", "the second"], ["Trials", "100"]],
        "drawings": [{"caption": "rates"}, {"caption": "times"}],
        "notes": ["A note."],
    }
    made = script("pictures").with_sparsity(page, content)
    assert made.partition(start)[0] == page.partition(start)[0]
    assert made.partition(start)[2].partition(end)[2] == page.partition(start)[2].partition(end)[2]
    section = made.partition(start)[2].partition(end)[0]
    assert "| one point | 98 % | 3 % |" in section
    assert re.findall(r"^### (.+)$", section, re.MULTILINE) == re.findall(
        r"^### (.+)$", page.partition(start)[2].partition(end)[0], re.MULTILINE
    )


def test_the_page_of_documents_names_the_schema() -> None:
    text = (DOCS / "documents.md").read_text("utf-8")
    assert f"`schema` ({SCHEMA}; `bfi report` reads analyses from {min(OLDEST_READ.values())} on)" in text


def test_the_pages_are_read_in_two_hours() -> None:
    """What is made from the code (pages, tables, outputs), displayed equations and the list of changes do not count."""
    made = {"CHANGELOG.md", "api.md", "commands.md"}
    texts = [re.sub(r"^<!-- \w+: .*?^<!-- end -->|\$\$.*?\$\$", "", prose(page), flags=re.DOTALL | re.MULTILINE)
             for page in PAGES if page.name not in made]  # fmt: skip
    assert sum(len(re.findall(r"\S*[A-Za-z]\S*", text)) for text in texts) <= MOST_WORDS


def test_the_index_names_every_page_and_example() -> None:
    text = (DOCS / "index.md").read_text("utf-8")
    wanted = [*(page.name for page in DOCS.glob("*.md") if page.stem != "index"), *(path.name for path in EXAMPLES)]
    assert [name for name in wanted if f"{name})" not in text] == []


def test_the_site_names_every_page_once() -> None:
    """Read without the tags of Python that mkdocs.yml has, so that nothing but YAML is needed."""

    def leaves(part: object) -> list[str]:
        if isinstance(part, str):
            return [part]
        return [page for below in (part.values() if isinstance(part, dict) else part) for page in leaves(below)]

    text = re.sub(r"!!python/\S+", "", (ROOT / "mkdocs.yml").read_text("utf-8"))
    named = leaves(yaml.safe_load(text)["nav"])
    assert sorted(named) == sorted(page.name for page in DOCS.glob("*.md"))


@pytest.mark.slow
def test_the_site_is_built_without_a_warning(tmp_path: Path) -> None:
    for module in ("mkdocs", "pymdownx"):
        pytest.importorskip(module, reason="mkdocs builds the site; it comes with the extra dev")
    built = subprocess.run(
        [sys.executable, "-m", "mkdocs", "build", "--strict", "--site-dir", tmp_path / "site"],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=False,
    )
    assert built.returncode == 0, built.stderr
    assert {page.stem for page in DOCS.glob("*.md")} <= {page.stem for page in (tmp_path / "site").glob("*.html")}


@pytest.mark.slow
@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_examples_run_and_write_into_the_folder_given_only(example: Path, tmp_path: Path) -> None:
    for package in re.findall(r"pip install (\w+)", example.read_text("utf-8")):
        pytest.importorskip(package)
    here, given = tmp_path / "here", tmp_path / "given"
    here.mkdir()
    given.mkdir()
    ran = subprocess.run(
        [sys.executable, "-W", "error", example, given],
        cwd=here,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
    )
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout.strip()
    assert list(here.iterdir()) == []
    assert len(example.read_text("utf-8").splitlines()) < LONGEST_EXAMPLE
