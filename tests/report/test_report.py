"""report.html: one file, valid, nothing fetched from anywhere, everything escaped."""

import base64
import json
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pytest

import proxcgal as px
from proxcgal.report.write_report import write_report

NASTY = '<script>alert("&")</script>'
VOID = {"meta", "img", "br", "hr", "link", "input"}
# The least PNG there is: one pixel.
PIXEL = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNkYPhfDwAChwGA60e6kgAAAABJRU5E"
    "rkJggg=="
)


def numbers(end: float) -> dict[str, Any]:
    return {
        "true_min_m": end - 0.02,
        "true_final_m": end,
        "seen_min_m": 9.99,
        "goal_error_m": 0.45,
        "violations": 0,
        "self_min_m": 0.1,
    }


def make_run(folder: Path, scenario: str = "front_plane", **about: Any) -> Path:
    """A folder as `proxcgal run` leaves it."""
    folder.mkdir(parents=True)
    summary = {
        "scenario": scenario,
        "robot": "ur10e",
        "seed": 3,
        "controllers": {"wb": numbers(0.238), "sm": numbers(0.074)},
        "gain_mm": 164.0,
        "self_min_m": 0.1,
        "failed": False,
    }
    trial = {
        "wall_s": 3.2,
        "tick_median_us": 412.0,
        "tick_p99_us": 700.0,
        "findings": {"zone_invalid": 40},
    }
    origin = {
        "command": "proxcgal run front_plane --out 'a b'",
        "made": "2026-01-01 00:00:00 UTC",
        "commit": "0123456789ab",
        "machine": "x86_64",
        "versions": {"proxcgal": "0.1.0", "mujoco": "4.0.0"},
        "description": "a panel in front of the flange",
        "trials": {"wb": trial, "sm": trial},
    }
    (folder / "summary.json").write_text(json.dumps(summary))
    (folder / "run.json").write_text(json.dumps({**origin, **about}))
    (folder / "scenario.toml").write_text('name = "front_plane"\n')
    (folder / "distance.png").write_bytes(PIXEL)
    (folder / "wb.mcap").write_bytes(b"")
    return folder


class Checker(HTMLParser):
    """Tags must be closed in order; attributes that fetch are collected."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.fetched: list[str] = []
        self.text = ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        self.fetched += [value or "" for name, value in attrs if name in ("src", "href", "srcset")]

    def handle_endtag(self, tag: str) -> None:
        assert self.open, f"</{tag}> closes nothing"
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data


def checked(path: Path) -> Checker:
    checker = Checker()
    checker.feed(path.read_text())
    checker.close()
    assert checker.open == []
    return checker


def test_the_page_is_well_formed_and_fetches_nothing(tmp_path: Path) -> None:
    page = checked(write_report(make_run(tmp_path / "run")))
    assert page.fetched
    assert all(address.startswith("data:") for address in page.fetched)
    assert "script" not in page.tags
    style = re.search("<style>(.*?)</style>", (tmp_path / "run/report.html").read_text(), re.DOTALL)
    assert style
    assert "url(" not in style[1]
    assert "@import" not in style[1]


@pytest.mark.parametrize(
    "fact",
    [
        "0.238", "0.074", "+164", "none", "up to 100 mm", "412", "zone_invalid: 40",
        "proxcgal run front_plane --out 'a b'", "0123456789ab", "4.0.0", "seed 3",
        'name = "front_plane"', "wb.mcap",
    ],
)  # fmt: skip
def test_the_page_says(tmp_path: Path, fact: str) -> None:
    assert fact in checked(write_report(make_run(tmp_path / "run"))).text


def test_the_page_tells_what_the_sensors_had_of_the_closest_points(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run")
    summary = json.loads((folder / "summary.json").read_text())
    shares = {"in_view": 0.72, "remembered": 0.11, "forgotten": 0.04, "never_seen": 0.13}
    nothing = {f"{name}_share": None for name in shares}
    summary["closest_points"] = {
        "wb": {f"{name}_share": share for name, share in shares.items()}, "sm": nothing,
    }  # fmt: skip
    assert "truly closest points" not in checked(write_report(folder)).text
    (folder / "summary.json").write_text(json.dumps(summary))
    table = checked(write_report(folder)).text.partition("truly closest points")[2]
    cells = table.partition("never seen%")[2].split("\n\n")[1:3]
    assert cells[0].split("\n") == ["wb, whole body", "72", "11", "4", "13"]
    assert cells[1].split("\n") == ["sm, sensor points", "-", "-", "-", "-"]


def test_pictures_are_inside_the_page(tmp_path: Path) -> None:
    page = write_report(make_run(tmp_path / "run")).read_text()
    assert base64.b64encode(PIXEL).decode() in page


def test_all_text_is_escaped(tmp_path: Path) -> None:
    folder = make_run(
        tmp_path / "run",
        scenario=NASTY,
        command=NASTY,
        description=NASTY,
        commit=NASTY,
        versions={NASTY: NASTY},
    )
    (folder / "scenario.toml").write_text(f"# {NASTY}\n")
    page = checked(write_report(folder))
    assert "script" not in page.tags
    assert page.text.count(NASTY) >= 7


def test_a_folder_of_several_scenarios_becomes_one_page(tmp_path: Path) -> None:
    summaries = {}
    for name in ("front_plane", "side_plane"):
        folder = make_run(tmp_path / name, scenario=name)
        summaries[name] = json.loads((folder / "summary.json").read_text())
    whole = {"scenarios": summaries, "self_min_m": 0.1, "failed": False}
    (tmp_path / "summary.json").write_text(json.dumps(whole))
    page = checked(write_report(tmp_path))
    assert page.tags.count("img") == 2
    assert page.tags.count("h2") == 3
    assert "Fig. 7" in page.text
    assert "Fig. 8" in page.text


def test_a_page_never_exceeds_10_mb_and_says_what_was_left_out(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run")
    (folder / "motion.gif").write_bytes(bytes(8_000_000))
    path = write_report(folder)
    assert path.stat().st_size <= 10_000_000
    assert "motion.gif: left out here" in checked(path).text


def test_a_page_needs_nothing_but_the_summary(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run")
    for name in ("run.json", "scenario.toml", "distance.png", "wb.mcap"):
        (folder / name).unlink()
    assert "0.238" in checked(write_report(folder)).text


def test_a_failed_run_is_called_failed(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "run")
    summary = json.loads((folder / "summary.json").read_text())
    summary |= {"failed": True, "self_min_m": 0.011}
    (folder / "summary.json").write_text(json.dumps(summary))
    assert "failed: the arm came within 0.011 m of itself" in checked(write_report(folder)).text


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (None, "missing"),
        ("{", "cannot be read as JSON"),
        ("[1]", "must hold a JSON object"),
        ('{"a": 1}', "neither `scenarios` nor `controllers`"),
        ('{"scenarios": {"../x": {}}}', "plain name"),
        ('{"controllers": {"wb": 3}}', "scenario"),
        ('{"scenario": "a", "robot": "b", "seed": 0, "controllers": {"wb": 3}}', "wb"),
    ],
)
def test_what_is_no_folder_of_results_is_refused(
    tmp_path: Path, content: str | None, message: str
) -> None:
    if content is not None:
        (tmp_path / "summary.json").write_text(content)
    with pytest.raises(px.ConfigError, match=re.escape(message)):
        write_report(tmp_path)
    assert not (tmp_path / "report.html").exists()


def test_a_missing_folder_is_named(tmp_path: Path) -> None:
    with pytest.raises(px.ConfigError, match="no such folder"):
        write_report(tmp_path / "nowhere")


def test_only_controllers_that_ran_are_explained(tmp_path: Path) -> None:
    text = write_report(make_run(tmp_path / "out")).read_text()
    assert "<code>sm</code>, the baseline" in text
    assert "wb_known" not in text
    assert "wb_memory" not in text


def test_the_moving_pictures_caption_tells_how_near_the_arms_came(tmp_path: Path) -> None:
    folder = make_run(tmp_path / "out")
    (folder / "motion.gif").write_bytes(PIXEL)
    text = write_report(folder).read_text()
    assert "least true distance: wb 0.218 m, sm 0.054 m" in text
    assert "backing away" not in text
