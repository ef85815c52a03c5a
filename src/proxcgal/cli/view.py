"""`proxcgal view`: a scene in the browser, live."""

from __future__ import annotations

import os
import secrets
import sys
import warnings
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import tyro

from proxcgal.cli.options import ControllerName, Settings, flat
from proxcgal.core.errors import ConfigError

if TYPE_CHECKING:
    from proxcgal.scenario.scenario import Scenario
    from proxcgal.viewer.live_page import LivePage

LOCAL = "127.0.0.1"
PORT = 8080


@dataclass(frozen=True)
class ViewOptions:
    """Simulate a scene in real time and look at it in the browser: drag the obstacle, or the hand.

    Only this machine can open the page, unless --host says otherwise; then a token is needed, which
    is part of the address that is printed.

    Examples:
      proxcgal view front_plane
      proxcgal view side_plane --controller sm --port 8090
      proxcgal view walkthrough_teach
      proxcgal view front_plane --host 0.0.0.0 --token a-long-secret
    """

    scenario: Annotated[str, tyro.conf.Positional, tyro.conf.arg(metavar="SCENARIO")]
    """A name that `proxcgal scenarios` lists, or a path to a TOML file."""
    controller: Annotated[
        ControllerName | None,
        tyro.conf.arg(metavar="wb|sm|wb_known|wb_memory", help_behavior_hint="(default: wb)"),
    ] = None
    """The law that begins; the page can change it. A walk-through has none."""
    set: Settings = ()
    """Change keys of the scenario, values as in TOML: controller.d_min=0.25"""
    host: Annotated[str, tyro.conf.arg(metavar="A")] = LOCAL
    """Address to listen on."""
    port: Annotated[int, tyro.conf.arg(metavar="N")] = PORT
    """Port to listen on; 0 takes any that is free."""
    token: Annotated[str | None, tyro.conf.arg(metavar="T", help_behavior_hint="")] = None
    """What a page must show; left out: none on this machine, a random one beyond it."""


def view_command(options: ViewOptions, command: str) -> int:
    """Serves until interrupted; prints the page's address."""
    from proxcgal.scenario.loading import load_scenario
    from proxcgal.viewer.access import close, serve
    from proxcgal.viewer.live_page import LivePage

    token = checked_token(options.host, options.port, options.token)
    scenario = load_scenario(options.scenario, flat(options.set))
    _check(scenario, options.controller)
    server, gate = serve(
        options.host, options.port, label=f"proxcgal: {scenario.name}", token=token
    )
    page = LivePage(server, gate, scenario, options.controller or "wb")
    os.nice(5)  # the page yields to the simulation, which has its process by now
    try:
        page.wait_for_scene()
        print(address(options.host, server.get_port(), token), flush=True)
        _attend(page)
    finally:
        page.close()
        close(server)
    return 0


def _check(scenario: Scenario, controller: str | None) -> None:
    """Does it fit? A walk-through's guard says what it monitors and what was accepted.

    Raises:
        ConfigError: what does not.
    """
    from proxcgal.scenario.walkthrough_scenario import WalkScenario
    from proxcgal.study.runs.results import check
    from proxcgal.trial.walkthrough.setup import WalkSetup

    if not isinstance(scenario, WalkScenario):
        check(scenario, [controller or "wb"])
        return
    if controller is not None:
        raise ConfigError(
            f'--controller {controller}: {scenario.name} has kind = "walkthrough", where a hand '
            "guides the arm: no controllers to choose from"
        )
    print("\n".join(WalkSetup.of(scenario).notes()))


def checked_token(host: str, port: int, token: str | None) -> str | None:
    """The token that pages must show, with a warning where others than this machine can ask.

    Raises:
        ConfigError: an address or a port that there is not, a token that is too easy to guess.
    """
    from proxcgal.viewer.access import LOOPBACK, check_free

    if not 0 <= port <= 65535:
        raise ConfigError(f"--port {port}: must be 0 to 65535")
    if token is not None and (len(token) < 8 or not token.isascii() or not _plain(token)):
        raise ConfigError(
            f"--token {token!r}: must be 8 characters or more, letters, digits, - and _ only"
        )
    if host in LOOPBACK:
        return token
    check_free(host, port)  # no word of who can reach a page that cannot be
    warnings.warn(
        f"--host {host}: others than this machine can reach the page; it is not encrypted, and "
        "whoever knows the token can look on and drag the obstacle",
        stacklevel=2,
    )
    return token or secrets.token_urlsafe(16)


def address(host: str, port: int, token: str | None) -> str:
    """What to open in a browser."""
    name = {"0.0.0.0": LOCAL, "::": "[::1]"}.get(host, f"[{host}]" if ":" in host else host)
    return f"http://{name}:{port}/" + (f"?token={token}" if token else "")


def _plain(token: str) -> bool:
    return token.replace("-", "").replace("_", "").isalnum()


def _attend(page: LivePage) -> None:
    """Until the simulation ends; on a terminal Enter begins anew, out of a STOP too."""
    if not sys.stdin.isatty():
        page.wait()
        return
    import threading

    print("Enter: begin anew, out of a STOP too; Ctrl-C: end", flush=True)

    def listen() -> None:
        for _ in sys.stdin:
            page.queue.want(anew=True)

    threading.Thread(target=listen, daemon=True).start()
    page.wait()
