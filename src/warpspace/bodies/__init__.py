"""Bodies of machines: meshes, generated or read with trimesh."""
