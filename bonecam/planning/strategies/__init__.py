"""Iso-height and rotary milling (compared with morphing by Gan et al. 2014), and finishing one open surface."""
