"""Mechanics: what force a cut takes, how far part and cutter yield to it, and what error that leaves.

engagement     the part of a cutter's edge that lies in material before a move is cut
chip           what one edge takes: the feed a tooth fz, thinner where the surface leans along the feed
mean, peak     the force over a turn of the spindle: its mean vector, and the largest
compliance     how far a place moves for a force there, mm/N
error kept     how far a finished place stays from where it should be, along its normal: what bending leaves
"""
