"""The plain baseline `ndsm`: a height threshold."""
