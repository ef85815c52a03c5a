"""Fuzz target: scenario files and overrides; one that is read is written and read the same.

What stands before the first zero byte is the file, each part behind one an override.
"""

from __future__ import annotations

from bounds import ViolationError, promises
from places import folder

from proxcgal.scenario.loading import load_scenario, parse_scenario


def once(data: bytes) -> None:
    """Reads a scenario from these bytes; raises where a promise is broken."""
    text, *overrides = data.split(b"\0")
    path = folder() / "scene.toml"
    path.write_bytes(text)
    with promises():
        scenario = load_scenario(path, [part.decode("utf-8", "replace") for part in overrides])
        if parse_scenario(scenario.to_toml(), str(path)) != scenario:
            raise ViolationError("the scenario written out is another one")
