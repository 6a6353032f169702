"""G-code programs: words, dialects, the control that executes them, and their moves."""
