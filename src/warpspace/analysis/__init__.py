"""Numbers drawn from error fields and Jacobians."""
