"""One file a kind of stock, named as `kind` in [stock] of a job names it; its KIND tells how a job gives one.

A new kind of stock is a new file here.
"""
