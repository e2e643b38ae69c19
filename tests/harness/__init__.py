"""How tests drive the program: the command line, a browser, processes that are killed."""
