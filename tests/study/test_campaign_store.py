"""A campaign's folder: what is in it is as it was written, or is refused by name."""

import json
import socket
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import proxcgal as px
from proxcgal.study.campaign_store import CampaignStore, Outcome
from proxcgal.study.cluster import Cluster
from proxcgal.study.runs.preparation import ready_folders


def changed(**entries: object) -> Callable[[dict[str, Any]], object]:
    return lambda content: {**content, **entries}


DAMAGE: dict[str, tuple[Callable[[dict[str, Any]], object], str]] = {
    "another trial's": (changed(key="b"), 'is of trial "b"'),
    "text for a number": (changed(row={"number": "1"}), "its checksum is another"),
    "another number": (changed(row={"number": 2}), "its checksum is another"),
    "a nested value": (changed(row={"number": [[1]]}), "number is .* a list of numbers is needed"),
    "a row that is none": (changed(row=[1]), "row is "),
    "a time that is text": (changed(wall_s="1"), 'wall_s is "1"'),
    "an error that is none": (changed(error=3), "error is 3"),
    "an entry more": (changed(more=1), "must hold"),
    "a list": (lambda content: [content], "must hold"),
    "no checksum": (lambda content: {k: v for k, v in content.items() if k != "sha256"},
                    "its checksum is another"),
}  # fmt: skip


@pytest.mark.parametrize("damage", DAMAGE)
def test_a_trial_that_is_not_as_it_was_written_is_refused(tmp_path: Path, damage: str) -> None:
    change, said = DAMAGE[damage]
    with CampaignStore(tmp_path, {}) as store:
        store.put(Outcome(key="a", row={"number": 1, "text": "x", "series": [0.1, None]}))
        assert store.outcomes(["a"])["a"].row == {"number": 1, "text": "x", "series": [0.1, None]}
        path = tmp_path / "trials" / "a.json"
        path.write_text(json.dumps(change(json.loads(path.read_text()))))
        with pytest.raises(px.ConfigError, match=said) as caught:
            store.outcomes(["a"])
        assert str(path) in str(caught.value)


def test_a_trial_nested_too_deep_is_refused(tmp_path: Path) -> None:
    with CampaignStore(tmp_path, {}) as store:
        (tmp_path / "trials" / "a.json").write_text("[" * 200_000)
        with pytest.raises(px.ConfigError, match=r"a\.json: is nested too deep"):
            store.outcomes(["a"])


def test_a_manifest_nested_too_deep_is_refused(tmp_path: Path) -> None:
    (tmp_path / "campaign.json").write_text("[" * 200_000)
    with pytest.raises(px.ConfigError, match=r"campaign\.json: cannot be read"):
        CampaignStore(tmp_path, {})


def test_a_second_run_into_one_folder_is_refused(tmp_path: Path) -> None:
    folder = tmp_path / "out"
    with ready_folders([folder]):
        (folder / "wb.mcap").write_text("of the first")
        with (
            pytest.raises(px.ConfigError, match="another process is at work on this folder"),
            ready_folders([folder]),
        ):
            pass
        assert (folder / "wb.mcap").read_text() == "of the first"
    with ready_folders([folder]):
        assert not (folder / "wb.mcap").exists()
    new = tmp_path / "new"
    with ready_folders([new]):
        assert new.is_dir()
    assert not new.exists()


@pytest.mark.parametrize("greeting", [b"", b"SSH-2.0-OpenSSH_9.2\r\n", b"HTTP/1.1 400 Bad\r\n\r\n"])
def test_what_is_no_scheduler_is_told_so(greeting: bytes) -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        kept = []

        def answer() -> None:
            kept.append(server.accept()[0])
            kept[0].sendall(greeting)

        threading.Thread(target=answer, daemon=True).start()
        address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
        with pytest.raises(px.ConfigError, match="no scheduler answers there") as caught:
            Cluster(address)
        assert "\n" not in str(caught.value)
