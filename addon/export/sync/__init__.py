"""What an edit changes of a scene that was exported before, and the scene that follows from it."""
