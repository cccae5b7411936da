"""Rows of a path as blocks: split where axes leave the straight line, without those that do not move."""
