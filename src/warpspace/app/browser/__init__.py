"""Scripts of our own and private parts of viser: what its public interface does not offer."""
