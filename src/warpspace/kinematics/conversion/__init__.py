"""One error set in another convention: the same field from other numbers, exactly.

Each module is one convention. What is exact is the rigid motion of every body at every position of
its axis: products of full rotations, nothing linearised.
"""
