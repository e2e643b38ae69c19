"""How two footprint sets are compared."""
