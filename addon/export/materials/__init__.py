"""Materials: shader trees to closures, closures to lobes (`engine.scene.Material`).

`evaluator.py` walks a tree; the modules nodes_* fill its tables of shaders; `materials.py` makes
the lobes.
"""
