"""How good any motion within the limits could be: lower bounds on criteria, by convex relaxation over states."""
