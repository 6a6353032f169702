"""Charts: gain bars, histograms, polar plots. matplotlib figures without pyplot or a display."""
