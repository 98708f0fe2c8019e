"""The NumPy executor of programs: it folds constants, and runs where there is no picture yet (over
vertices, skies, what glows) and in the float64 tracer. `operations.py` runs one operation, which is
all that graphs fold by; `run.py` runs the programs that are made of graphs.
"""
