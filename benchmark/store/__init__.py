"""The results store: one SQLite file."""
