"""What is run and what follows from it: suites, runner, results store, analyses."""
