"""What a page says and asks: errors, the bar at the top, what lies over the drawing, five tasks."""
