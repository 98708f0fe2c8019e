"""What Blender shows: panels, properties, the Blinn-Phong node, menus."""
