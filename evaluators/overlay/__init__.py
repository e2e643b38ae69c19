"""Overlay: what every evaluator stands on. Overlaps, areas, pixels, distances between outlines."""
