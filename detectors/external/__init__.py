"""Detectors that are not Python: programs that are run, and footprints that were made elsewhere."""
