"""What a machine looks like: meshes, generated or read with trimesh."""
