"""The reference example: printed and computed numbers of the thesis."""
