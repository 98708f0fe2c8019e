"""Programs that compute what varies over a surface: the operations' table, expression graphs and
their compiler. No Blender here, and no scene.
"""
