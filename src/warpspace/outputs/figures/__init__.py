"""One module a figure; `warpspace.outputs.figures.catalogue` lists them."""
