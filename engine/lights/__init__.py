"""Lights that are tables of samples which all pixels share: skies, and what glows."""
