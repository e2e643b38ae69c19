"""Scenes and their parts: footprints, rasters, points, scenes, import and the synthetic generator."""
