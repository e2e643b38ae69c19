"""What every room uses: errors, parameters, the registry of plugins, whole-file output."""
