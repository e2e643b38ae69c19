"""Slow, obvious oracles: what each fast kernel must compute, in plain loops."""
