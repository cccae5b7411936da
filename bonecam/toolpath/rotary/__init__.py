"""Sectional rotary milling: sections of the part as it turns (compared with morphing by Gan et al. 2014)."""
