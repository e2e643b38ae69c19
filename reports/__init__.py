"""What people see: tables, plots, maps."""
