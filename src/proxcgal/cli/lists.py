"""`proxcgal scenarios`: what there is."""

from dataclasses import dataclass


@dataclass(frozen=True)
class ScenariosOptions:
    """The built-in scenarios, a line each.

    Any of them can be copied and changed: `proxcgal run NAME` writes the resolved file beside its
    results.

    Examples:
      proxcgal scenarios
    """


def scenarios_command(options: ScenariosOptions, command: str) -> int:
    """Lists the scenarios."""
    from proxcgal.scenario.loading import list_scenarios

    print_columns(list_scenarios())
    return 0


def print_columns(listed: dict[str, str]) -> None:
    """Prints names and what is said of each, in two columns."""
    width = max(map(len, listed), default=0)
    for name, description in listed.items():
        print(f"{name.ljust(width)}  {description}".rstrip())
