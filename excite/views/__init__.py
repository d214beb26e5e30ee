"""What is shown of results, stated once: the terminal, the page and JSON only render it."""
