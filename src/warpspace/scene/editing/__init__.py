"""Changes of the machine of a scene: pure functions from one valid scene to another one."""
