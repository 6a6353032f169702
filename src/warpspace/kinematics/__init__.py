"""How errors travel along the kinematic chain: exactly, and to first order."""
