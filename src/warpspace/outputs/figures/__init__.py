"""The figures; `warpspace.outputs.figures.registry` lists them."""
