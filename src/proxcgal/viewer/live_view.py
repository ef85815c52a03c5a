"""A scene on the live page, from the terminal that serves it."""

import os
import sys
import threading

from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.walkthrough_scenario import WalkScenario
from proxcgal.study.runs.preparation import check_setup
from proxcgal.trial.walkthrough.setup import WalkSetup
from proxcgal.viewer.live_page import LivePage
from proxcgal.viewer.page_server import page_address, served_page


def view_scenario(
    scenario: Scenario, controller: str, *, host: str, port: int, token: str | None
) -> None:
    """Serves the live page until interrupted; prints its address.

    Args:
        scenario: of a walk-through, its guard's bounds are printed first.
        controller: that begins; a walk-through has none.
        host: address to listen on.
        port: 0 for any that is free.
        token: that every viewer must show, as `checked_token` gives it.

    Raises:
        ProxError: what of the scenario does not fit, an address that cannot be listened on, a
            simulation that failed.
    """
    if isinstance(scenario, WalkScenario):
        print("\n".join(WalkSetup.of(scenario).notes()))
    else:
        check_setup(scenario, [controller])
    label = f"proxcgal: {scenario.name}"
    with served_page(host, port, label=label, token=token) as (server, access):
        page = LivePage(server, access, scenario, controller)
        os.nice(5)  # the page yields to the simulation, which has its process by now
        try:
            page.wait_for_scene()
            print(page_address(host, server.get_port(), token), flush=True)
            _attend(page)
        finally:
            page.close()


def _attend(page: LivePage) -> None:
    """Waits until the simulation ends; on a terminal Enter restarts it, out of a STOP too."""
    if sys.stdin.isatty():
        print("Enter: begin anew, out of a STOP too; Ctrl-C: end", flush=True)

        def listen() -> None:
            for _ in sys.stdin:
                page.queue.put(restart=True)

        threading.Thread(target=listen, daemon=True).start()
    page.wait()
