"""Rotary angles along a path: the choice of solutions and turns, and what planning must know of it."""
