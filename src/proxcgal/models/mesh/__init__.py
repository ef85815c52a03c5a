"""Triangle meshes: files, resolution, and what is drawn."""
