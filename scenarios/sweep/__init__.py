"""Many runs of one scenario: a grid of parameters times seeds, one table, plots and a report."""
