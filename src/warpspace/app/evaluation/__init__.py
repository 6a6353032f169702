"""From a state to values: numpy only, no browser."""
