"""Posting: from tool paths to the text of a program."""
