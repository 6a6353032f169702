"""A scene to start from: any chain, with sizes that fit together and a remark on every line."""

from warpspace.scene.starter.text import starter_scene, starter_text

__all__ = ["starter_scene", "starter_text"]
