"""What a VL53L8CX makes of the rays' lengths: z distance, noise, rounding, status codes.

Every draw belongs to (seed, scan index, sensor, zone), never to the order of calls: two
controllers that run the same scene with the same seed meet the same noise.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from proxcgal import _core
from proxcgal.core.typing import Array
from proxcgal.scenario.simulation_keys import SimulationKeys
from proxcgal.scenario.skin_keys import SensorKeys

ZONES = 64
VALID, NO_TARGET, UNCERTAIN = 5, 255, (6, 9)
_STREAM = 1  # of the seed; faults draw from another


class RangeModel:
    """The simulated sensors of one skin."""

    def __init__(
        self, simulation: SimulationKeys, sensor: SensorKeys, sensors: int, seed: int
    ) -> None:
        """Args: `sensors` is how many there are; the rest as in the scenario."""
        self._simulation = simulation
        self._sensor = sensor
        self._sensors = sensors
        self._seed = seed
        self._index, self._drawn = -1, (np.empty(0),) * 3  # draws of the scan made last
        rays = _directions(sensor.field_of_view, simulation.sub_rays)
        length = np.linalg.norm(rays, axis=1)
        #: (64 * sub_rays, 3) unit directions in the sensor's frame, zone by zone.
        self.rays_S: Array = rays / length[:, None]
        self._z_per_length: Array = 1.0 / length

    def measure(
        self, rows: Sequence[int], index: int, lengths: Array
    ) -> tuple[Array, NDArray[np.uint8]]:
        """Scans of some sensors.

        Args:
            rows: (k,) of the skin.
            index: how many scans these sensors made before.
            lengths: (k, 64 * sub_rays) [m] along `rays_S`, inf where nothing is hit.

        Returns:
            ranges (k, 64) [m] along z, 0 where there is no target; status (k, 64).
        """
        noise, lost, doubted = (draw[rows] for draw in self._draws(index))
        true = self._along_z(lengths).min(axis=2)
        hit = np.isfinite(true)
        range_z = np.where(hit, true, 0.0)
        settings = self._simulation
        sigma = np.maximum(settings.sigma_floor, settings.sigma_ratio * range_z)
        range_z = range_z + settings.bias + sigma * noise
        if settings.resolution > 0.0:
            # whole steps of 1 mm divided by 1000 are the doubles nearest to the millimetres
            per_metre = 1.0 / settings.resolution
            range_z = np.rint(range_z * per_metre) / per_metre
        target = hit & (lost >= settings.dropout)
        target &= (range_z >= self._sensor.min_range) & (range_z <= self._sensor.max_range)
        status = np.where(target, VALID, NO_TARGET).astype(np.uint8)
        unsure = target & (doubted < settings.uncertain)
        status[unsure] = np.where(doubted < 0.5 * settings.uncertain, *UNCERTAIN)[unsure]
        return np.where(target, range_z, 0.0), status

    def pick(self, lengths: Array, of_rays: NDArray[Any]) -> NDArray[Any]:
        """(k, 64): of each zone's rays, the value of the one that counts."""
        nearest = self._along_z(lengths).argmin(axis=2)[..., None]
        return np.take_along_axis(self._zones(of_rays), nearest, axis=2)[..., 0]

    def _along_z(self, lengths: Array) -> Array:
        return self._zones(lengths * self._z_per_length)

    def _zones(self, of_rays: NDArray[Any]) -> NDArray[Any]:
        return of_rays.reshape(len(of_rays), ZONES, self._simulation.sub_rays)

    def _draws(self, index: int) -> tuple[Array, Array, Array]:
        if index != self._index:  # scans come in order: one index at a time is enough
            generator = np.random.default_rng([self._seed, _STREAM, index])
            shape = (self._sensors, ZONES)
            noise, lost = generator.standard_normal(shape), generator.random(shape)
            self._index, self._drawn = index, (noise, lost, generator.random(shape))
        return self._drawn


def _directions(field_of_view: float, sub_rays: int) -> Array:
    """(64 * sub_rays, 3) per unit of z, zone by zone; light knows only the tangent form."""
    model = _core.SensorModel(field_of_view=field_of_view)
    angles = np.arctan(np.asarray(_core.zone_directions(model))[:, :2])
    side = round(sub_rays**0.5)
    offsets = ((np.arange(side) + 0.5) / side - 0.5) * field_of_view / 8.0
    grid = np.stack(np.meshgrid(offsets, offsets, indexing="ij"), axis=-1).reshape(-1, 2)
    tangents = np.tan(angles[:, None, :] + grid[None, :, :]).reshape(-1, 2)
    return np.column_stack([tangents, np.ones(len(tangents))])
