"""From a task to the best motion: problem, initial guesses, solvers, designs, comparison, campaigns."""
