"""Files that are written and read: one format each."""
