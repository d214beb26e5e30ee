"""Files that are written whole or not at all, and folders that vanish if the work fails."""
