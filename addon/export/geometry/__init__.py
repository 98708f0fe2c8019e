"""Shapes: meshes, strands, spheres and point clouds in object space."""
