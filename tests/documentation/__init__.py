"""The documentation as a site: what is generated for it, and the commands that its pages show."""
