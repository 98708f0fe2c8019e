"""Lights that are tables of samples which all pixels share: skies, what glows, bounced light."""
