"""What measures, compares, predicts and explains pictures; it renders through the engine's own
API.
"""
