"""The errors that set-up raises. The tick raises none for data: it reports findings."""


class ProxError(Exception):
    """Root of all errors that proxcgal raises on purpose."""


class ConfigError(ProxError, ValueError):
    """A setting that is out of bounds, unknown, or contradicts another."""


class ModelError(ProxError, ValueError):
    """A robot description that cannot be turned into a robot."""


class GeometryError(ProxError, ValueError):
    """A mesh, point or array that no query can be asked of."""


class SimulationError(ProxError):
    """The simulator warned or diverged: the run is void."""


class RecordingError(ProxError):
    """A file that is no recording, or one that cannot be written or read any further."""


class ModelWarning(UserWarning):
    """A robot that loads, but not quite as asked for."""
