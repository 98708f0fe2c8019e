"""What the engine raises of its own."""

NO_THREAD = (
    "the system starts no further thread: close programs, or let a user have more of them "
    "(ulimit -u)"
)


class SceneError(ValueError):
    """The scene or the settings cannot be rendered; the message lists every problem."""
