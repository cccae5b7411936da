"""Rational Bezier patches and their basis: find the element, evaluate, differentiate."""
