"""Contacts of a level and the passes through them; what is left out, lifted or cut in steps."""
