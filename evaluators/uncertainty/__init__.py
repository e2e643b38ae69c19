"""Uncertainty of the indices of one comparison: intervals, redrawn references, and two detections paired."""
