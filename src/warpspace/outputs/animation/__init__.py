"""Animations: pictures of a motion, joined to a GIF, WebP or MP4."""
