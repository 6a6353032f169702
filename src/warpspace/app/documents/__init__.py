"""What is opened, saved, linked and exported."""
