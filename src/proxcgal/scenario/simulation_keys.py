"""The keys of a scenario's `[simulation]`: rates, and what the simulated sensors really do."""

from typing import Literal

from pydantic import Field

from proxcgal.core.schema import NonNegative, Positive, Section, Share, core_key


class SimulationKeys(Section):
    """Rates, and what the simulated sensors really do."""

    control_hz: Positive = Field(100.0, ge=2, le=1e4, description="ticks a second, 2 to 10000")
    sensor_hz: Positive = Field(
        15.0, le=1e4, description="scans of each sensor a second, at most 10000"
    )
    stagger: bool = Field(False, description="sensors take turns instead of measuring at once")
    known_spacing: Positive = Field(
        0.01, description="[m] between known points, along the edges of the scene's surfaces"
    )
    sub_rays: Literal[1, 4, 9, 16] = Field(
        1, description="rays cast in each zone, of which the nearest counts"
    )
    sigma_floor: float = core_key("SensorModel", "sigma_floor")
    sigma_ratio: float = core_key("SensorModel", "sigma_ratio")
    bias: float = Field(0.0, description="[m] added to every range")
    dropout: Share = Field(0.02, description="share of zones that lose their target in a scan")
    uncertain: Share = Field(0.0, description="share of targets that come with status 6 or 9")
    resolution: NonNegative = Field(0.001, description="[m] ranges are rounded to it; 0: not")
    mounting: NonNegative = Field(
        0.005, description="[m] of each ray that lies inside the sensor's own mounting"
    )
