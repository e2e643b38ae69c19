"""Import of real scenes: one module for each layer."""
