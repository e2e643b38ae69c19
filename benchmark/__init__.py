"""What is run: suites, runner, results store, command line."""
