"""Analysis: what stored results amount to."""
