"""Meshes of another robot or resolution are made beside the running simulation, once."""

import contextlib
import multiprocessing
from multiprocessing.process import BaseProcess

from proxcgal.core.errors import ProxError
from proxcgal.models.mesh.display import display_meshes
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import make_robot
from proxcgal.viewer.choice import Choice


class Preparation:
    """Fills the cache for one choice at a time, in a process of its own: no tick waits for it."""

    def __init__(self, scenario: Scenario) -> None:
        """Args: what the page shows; its own robot is there already."""
        self._scenario = scenario
        self._ready = {(scenario.robot, scenario.vertices_per_link)}
        self._process: BaseProcess | None = None
        self._choice: Choice | None = None

    @property
    def busy(self) -> bool:
        """Whether something is being made."""
        return self._process is not None

    def asked(self, choice: Choice) -> Choice | None:
        """The choice, where all is there; else it is begun, in place of what was being made."""
        self.close()
        if (choice.robot, choice.vertices) in self._ready:
            return choice
        self._choice = choice
        self._process = multiprocessing.get_context("spawn").Process(
            target=prepare, args=(self._scenario, choice), daemon=True
        )
        self._process.start()
        return None

    def done(self) -> Choice | None:
        """The choice whose meshes are ready now; errors are reported when it is set up."""
        if self._process is None or self._process.is_alive():
            return None
        choice, self._process, self._choice = self._choice, None, None
        if choice is not None:
            self._ready.add((choice.robot, choice.vertices))
        return choice

    def close(self) -> None:
        """Gives up what is being made."""
        if self._process is not None:
            self._process.terminate()
            self._process.join(timeout=2.0)
            self._process = self._choice = None


def prepare(scenario: Scenario, choice: Choice) -> None:
    """Makes the meshes, which stay in the cache; the target of a process."""
    with contextlib.suppress(ProxError, KeyboardInterrupt):
        display_meshes(make_robot(choice.applied(scenario)))
