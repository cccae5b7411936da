"""Stage 7: proof from the posted text, report and pictures."""
