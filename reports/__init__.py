"""Text, tables, maps, figures and pages, drawn from finished results."""
