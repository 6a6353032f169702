"""The viser server and the sessions of its browser tabs."""
