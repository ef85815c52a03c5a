"""README: its Python runs as written, its commands exist; docs name files that are there."""

import re
import shlex
import subprocess
import sys
from pathlib import Path

import pytest

import proxcgal as px
from proxcgal.cli import main

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text()


def blocks(language: str, text: str = README) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.MULTILINE | re.DOTALL)


def commands(text: str = README) -> list[str]:
    lines = [
        line.partition("#")[0].strip()
        for block in blocks("sh", text)
        for line in block.splitlines()
    ]
    return [line for line in lines if line]


def test_the_python_blocks_run_in_their_order(tmp_path: Path) -> None:
    code = "\n".join(blocks("python"))
    assert code.count("px.") >= 5
    done = subprocess.run(
        [sys.executable, "-W", "error::DeprecationWarning", "-c", code],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert "true_min_m" in done.stdout


@pytest.mark.parametrize("line", [c for c in commands() if c.startswith("proxcgal ")])
def test_a_command_of_the_readme_parses(line: str) -> None:
    _, command, *arguments = shlex.split(line)
    assert main.parse_options(command, arguments) is not None


def test_every_command_of_the_docs_parses() -> None:
    lines = {
        line: path.name
        for path in sorted((ROOT / "docs").glob("*.md"))
        for line in commands(path.read_text())
        if line.startswith("proxcgal ")
    }
    assert len(set(lines.values())) >= 3
    for line in lines:
        _, command, *arguments = shlex.split(line)
        assert main.parse_options(command, arguments) is not None, line


@pytest.mark.parametrize("document", ["joint_robot.md"])
def test_the_python_blocks_of_a_document_run_in_their_order(document: str, tmp_path: Path) -> None:
    code = "\n".join(blocks("python", (ROOT / "docs" / document).read_text()))
    assert "px." in code
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize("line", [c for c in commands() if c.startswith("./run ")])
def test_a_run_command_of_the_readme_exists(line: str) -> None:
    usage = subprocess.run(
        [ROOT / "run", "help"], capture_output=True, text=True, check=True
    ).stdout
    assert re.search(rf"^  {shlex.split(line)[1]}\b", usage, re.MULTILINE)


def test_every_shell_command_is_checked_here() -> None:
    rest = [c for c in commands() if not c.startswith(("proxcgal ", "./run "))]
    assert rest == ["source .venv/bin/activate"]


def test_every_file_that_the_readme_shows_or_links_is_there() -> None:
    links = re.findall(r"\]\(([^)#]+)[^)]*\)", README)
    assert links
    assert [link for link in links if "://" not in link and not (ROOT / link).exists()] == []


@pytest.mark.parametrize("document", ["conventions.md", "sources.md"])
def test_every_source_file_that_a_document_names_is_there(document: str) -> None:
    text = (ROOT / "docs" / document).read_text()
    named = re.findall(r"`((?:cpp|src|tests|scenarios|docs)/[^`*]*)", text)
    places = (ROOT, ROOT / "src" / "proxcgal")
    assert [name for name in named if not any((place / name).exists() for place in places)] == []


def test_conventions_explain_every_finding_and_every_mode() -> None:
    text = (ROOT / "docs" / "conventions.md").read_text()
    monitor = (ROOT / "cpp" / "src" / "safety" / "monitor.cpp").read_text()
    reasons = set(re.findall(r'return "(\w+)";', monitor)) - {"unknown"}
    assert reasons
    assert {reason for reason in reasons if f"| `{reason}` |" not in text} == set()
    assert {mode.name for mode in px.Mode if f"| {mode.name} |" not in text} == set()


def test_the_commands_come_before_what_it_does_and_the_picture_before_them() -> None:
    places = [README.index(text) for text in ("**Ranges", "![", "./run demo", "## What it does")]
    assert places == sorted(places)
