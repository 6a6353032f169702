"""One module a figure; `warpspace.outputs.figures.registry` lists them."""
