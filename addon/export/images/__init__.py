"""Images: Blender's pixels to `engine.scene.Texture`, decoded once and kept between renders."""
