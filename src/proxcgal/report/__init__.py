"""The report of a results folder: one self-contained HTML page."""
