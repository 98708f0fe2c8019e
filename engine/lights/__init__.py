"""Lights that are tables of samples, shared or dealt among pixels: skies, and what glows."""
