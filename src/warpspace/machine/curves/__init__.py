"""The kinds of curve that an error follows along its axis, one module each."""
