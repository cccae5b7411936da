"""Stage 5: tool axes free of collision, and the moves between passes."""
