"""The machine of a state while it is being changed: pure updates, and the library to start from."""
