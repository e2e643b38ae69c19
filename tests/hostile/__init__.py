"""Files, names and places made to break a program, and a sandbox in which the command line meets them."""
