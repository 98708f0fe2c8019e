"""What a user does with Glint beyond F12."""

MODULES = (
    "add_demo_scene",
    "switch_engine",
    "measure_scene",
    "compare_cycles",
    "explain_pixel",
    "command_line",
)
"""The operators and the command line."""
