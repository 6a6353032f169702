"""Files and figures: export, drawing, charts, reports; renderers of pictures."""
