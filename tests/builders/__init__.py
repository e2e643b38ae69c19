"""Inputs made for tests: scenes, files, footprint sets and reports."""
