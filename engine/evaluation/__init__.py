"""What a scene has at given points and what its materials' factors, skies and media give there, in
float64: for what is worked out before there is a picture, and for the float64 tracer. No ray is
traced here.
"""
