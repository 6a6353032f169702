"""Exports: the deformed scene and its error field as files for other programs."""
