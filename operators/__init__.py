"""What a user does with Glint beyond F12."""

MODULES = (
    "add_demo_scene",
    "switch_engine",
    "measure_scene",
    "compare_cycles",
    "explain_pixel",
    "written_pictures",
    "command_line",
)
"""The operators, the command line and what looks at written files."""
