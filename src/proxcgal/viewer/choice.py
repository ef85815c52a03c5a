"""Choices of a page: controller, robot, meshes, noise, and three of the controller's settings."""

from __future__ import annotations

from dataclasses import dataclass

from proxcgal.core.errors import ConfigError
from proxcgal.scenario.loading import change_scenario, list_scenarios, load_scenario
from proxcgal.scenario.scenario import CONTROLLERS, Scenario

#: Vertices a link of the controller's meshes.
RESOLUTIONS = (100, 300, 1000, 3000, 10000)
#: Least and most of the sliders, and their step: no message leads outside of them.
D_MIN = (0.05, 0.5, 0.01)  # [m]
BUFFER = (0.05, 0.5, 0.01)  # [m]
GAIN = (0.2, 4.0, 0.1)  # [1/s]


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice:
    """One setting of the page's switches and sliders."""

    controller: str
    robot: str
    vertices: int
    noise: bool
    d_min: float  #: [m]
    buffer: float  #: [m]
    gain: float  #: [1/s]

    @classmethod
    def of(cls, scenario: Scenario, controller: str) -> Choice:
        """Those of a scenario as it is."""
        settings = scenario.controller
        return cls(
            controller=controller, robot=scenario.robot, vertices=scenario.vertices_per_link,
            noise=True, d_min=settings.d_min, buffer=settings.buffer, gain=settings.avoid_gain,
        )  # fmt: skip

    def applied(self, scenario: Scenario) -> Scenario:
        """The scenario with these.

        Another robot brings its own start, goal and sensors, those of a built-in scene with it.

        Raises:
            ConfigError: what the page does not offer; what does not fit.
        """
        self._check(scenario)
        changed = scenario
        if self.robot != scenario.robot:
            other = scenes_by_robot()[self.robot]
            kept = ("robot", "q0", "goal", "skin", "limits", "package_dirs")
            changed = changed.model_copy(update={name: getattr(other, name) for name in kept})
        if not self.noise:
            # Without noise a scene at rest repeats itself: that is no fault then.
            monitor = changed.controller.monitor.model_copy(update={"suspect_repeats": 0})
            settings = changed.controller.model_copy(update={"monitor": monitor})
            quiet = dict.fromkeys(
                ("sigma_ratio", "sigma_floor", "bias", "dropout", "uncertain"), 0.0
            )
            changed = changed.model_copy(
                update={
                    "controller": settings,
                    "simulation": changed.simulation.model_copy(update=quiet),
                }
            )
        return change_scenario(
            changed, "page",
            [
                f"vertices_per_link={self.vertices}", f"controller.d_min={self.d_min!r}",
                f"controller.buffer={self.buffer!r}", f"controller.avoid_gain={self.gain!r}",
            ],
        )  # fmt: skip

    def _check(self, scenario: Scenario) -> None:
        settings = scenario.controller
        problems = [
            f"{name} = {value!r}: there are {', '.join(map(str, allowed))}"
            for name, value, allowed in (
                ("controller", self.controller, CONTROLLERS),
                ("robot", self.robot, robots(scenario)),
                ("vertices", self.vertices, resolutions(scenario)),
            )
            if value not in allowed
        ]
        problems += [
            f"{name} = {number:g}: from {low:g} to {high:g}"
            for name, number, (low, high, _), own in (
                ("d_min", self.d_min, D_MIN, settings.d_min),
                ("buffer", self.buffer, BUFFER, settings.buffer),
                ("gain", self.gain, GAIN, settings.avoid_gain),
            )
            if not min(low, own) <= number <= max(high, own)
        ]
        if problems:
            raise ConfigError("\n".join(problems))


def robots(scenario: Scenario) -> tuple[str, ...]:
    """The robots that may stand in this scene, its own first."""
    return tuple(dict.fromkeys([scenario.robot, *scenes_by_robot()]))


def resolutions(scenario: Scenario) -> tuple[int, ...]:
    """Vertices a link that may be chosen; 0: as they are."""
    return tuple(sorted({scenario.vertices_per_link, *RESOLUTIONS}))


def scenes_by_robot() -> dict[str, Scenario]:
    """For each robot, the first built-in static scene that brings sensors for it."""
    found: dict[str, Scenario] = {}
    for name in list_scenarios():
        scenario = load_scenario(name)
        if scenario.kind == "static" and scenario.skin.rings:
            found.setdefault(scenario.robot, scenario)
    return found
