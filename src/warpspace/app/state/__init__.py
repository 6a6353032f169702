"""What a tab shows, as frozen values; every change of it is a pure function."""
