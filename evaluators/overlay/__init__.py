"""Overlay, the base of every evaluator: overlaps, areas, pixels, distances between outlines."""
