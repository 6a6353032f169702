"""What a machine is: its axes, its error parameters and the functions they follow."""
