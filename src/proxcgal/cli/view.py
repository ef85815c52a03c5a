"""`proxcgal view`: a scene in the browser, live."""

from dataclasses import dataclass
from typing import Annotated

import tyro

from proxcgal.cli.options import ControllerName, Settings, flat
from proxcgal.core.errors import ConfigError

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
    from proxcgal.viewer.live_view import view_scenario
    from proxcgal.viewer.page_server import checked_token

    token = checked_token(options.host, options.port, options.token)
    scenario = load_scenario(options.scenario, flat(options.set))
    if scenario.kind == "walkthrough" and options.controller is not None:
        raise ConfigError(
            f'--controller {options.controller}: {scenario.name} has kind = "walkthrough", where a '
            "hand guides the arm: no controllers to choose from"
        )
    view_scenario(
        scenario, options.controller or "wb", host=options.host, port=options.port, token=token
    )
    return 0
