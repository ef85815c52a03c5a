"""A campaign while it is planned: scenes checked and named once, trials made from them."""

from collections.abc import Sequence

from proxcgal.core.errors import ConfigError
from proxcgal.models.robots import Robot
from proxcgal.scenario.scenario import Scenario
from proxcgal.scenario.setup import Setup
from proxcgal.study.campaign import Campaign, Perform, Trial, file_name
from proxcgal.study.campaign_kind import CampaignRequest
from proxcgal.study.campaign_store import Value
from proxcgal.study.trial_simulation import robot_of, scene_digests


class CampaignPlan:
    """Scenes and trials so far."""

    def __init__(self, kind: str, request: CampaignRequest, scenarios: Sequence[str]) -> None:
        """No trial yet.

        Args:
            kind: of the campaign.
            request: what the user asks for.
            scenarios: names or files of the kind's own, which the request may replace.
        """
        self.scenarios = request.scenarios or tuple(scenarios)
        self.trials: list[Trial] = []
        self._kind, self._request = kind, request
        self._names: set[str] = set()
        self._digests: dict[str, str] = {}

    def add_scene(
        self, source: str, base: Scenario, name: str | None = None, *, by: str = "named"
    ) -> Setup:
        """Sets a scene up before anything is drawn round it.

        Args:
            source: name or file that it was read from.
            base: the scene.
            name: that no other scene of the campaign may have; left out: its own, as a file's.
            by: what the name is, in the message about a second one.

        Raises:
            ProxError: what does not fit, a second scene of that name.
        """
        setup = Setup.of(base, robot_of(base))
        name = file_name(base.name) if name is None else name
        if file_name(name) in self._names:
            raise ConfigError(f"--scenario {source}: there is another one {by} {name}")
        self._names.add(file_name(name))
        self._digests |= scene_digests(base, setup.robot)
        return setup

    def add_robot(self, name: str, robot: Robot) -> None:
        """Notes the robot of trials whose scenes have no digest of their own."""
        self._digests[f"robot of {name}"] = robot.digest

    def add_trial(
        self,
        scenario: Scenario,
        source: str,
        overrides: Sequence[str],
        controller: str,
        seed: int,
        robot: Robot,
        /,
        **tags: Value,
    ) -> None:
        """Adds a trial; `seed` counts from the request's, `tags` say which trial it is."""
        self.trials.append(
            Trial(
                scenario=scenario, source=source, overrides=tuple(overrides), controller=controller,
                seed=self._request.seed + seed, robot_digest=robot.digest, tags=tags,
            )
        )  # fmt: skip

    def campaign(self, perform: Perform, columns: Sequence[str], **notes: object) -> Campaign:
        """The planned campaign.

        Args:
            perform: performs a trial.
            columns: names of the numbers that it gives.
            notes: on how the trials came about.
        """
        description = {
            "kind": self._kind, "seed": self._request.seed, "scenarios": list(self.scenarios),
            "set": list(self._request.overrides), **self._digests,
        }  # fmt: skip
        return Campaign(
            description=description, trials=self.trials, perform=perform, columns=columns,
            notes=notes,
        )  # fmt: skip
