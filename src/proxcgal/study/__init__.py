"""Campaigns of many trials: workers, tables, statistics, figures."""
