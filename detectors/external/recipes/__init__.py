"""Scripts that use an installed tool as a detector, one file a tool; run by `command[recipe=NAME]`."""
