"""The formats, one module each; `warpspace.formats.registry` lists them."""
