"""What the engine raises of its own."""


class SceneError(ValueError):
    """The scene or the settings cannot be rendered; the message lists every problem."""
