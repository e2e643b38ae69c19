"""What the world looks like: footprints, rasters, points, scenes, import and the synthetic generator."""
