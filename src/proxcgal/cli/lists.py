"""`proxcgal scenarios` and `proxcgal robots`: what there is."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ScenariosOptions:
    """The built-in scenarios, a line each.

    Any of them can be copied and changed: `proxcgal run NAME` writes the resolved file beside its
    results.

    Examples:
      proxcgal scenarios
    """


@dataclass(frozen=True)
class RobotsOptions:
    """The built-in robots, a line each.

    Examples:
      proxcgal robots
    """


def scenarios_command(options: ScenariosOptions, command: str) -> int:
    """Lists the scenarios."""
    from proxcgal.scenario.loading import list_scenarios

    _columns(list_scenarios())
    return 0


def robots_command(options: RobotsOptions, command: str) -> int:
    """Lists the robots."""
    from proxcgal.models.builtin import list_robots

    _columns(list_robots())
    return 0


def _columns(listed: dict[str, str]) -> None:
    width = max(map(len, listed), default=0)
    for name, description in listed.items():
        print(f"{name.ljust(width)}  {description}".rstrip())
