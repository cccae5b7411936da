"""Smooth fields of tool axes over a level (Xu et al. 2013, Eq. 22, in the angles of the machine)."""
