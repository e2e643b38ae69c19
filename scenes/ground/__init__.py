"""Bare earth, and heights above it."""
