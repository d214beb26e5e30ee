"""The shortest experiment that meets a precision: periods and runs, and what keeps a precision out of reach."""
