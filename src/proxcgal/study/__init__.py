"""Many trials: workers, numbers and figures."""
