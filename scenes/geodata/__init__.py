"""Geodata: footprints, points, rasters, coordinate reference systems, and the files that hold them."""
