"""What the columns of a recording may be: from their names, from definitions, and from their numbers."""
