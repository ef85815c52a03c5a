"""Shared by all rooms: errors, types, transforms, files, provenance, progress."""
