"""Whether a result can be right: checks of the residual, the mass matrix, the rows and the parameters."""
