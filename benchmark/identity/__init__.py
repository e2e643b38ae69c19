"""Identity: what a stored result depends on, and how a scene or a detector is made again."""
