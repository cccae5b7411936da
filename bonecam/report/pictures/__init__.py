"""Pictures of what was made, each drawn by one file. The only door to matplotlib, which loads when a picture
is drawn and needs no display."""
