"""Material removal simulated from the posted text: what each move removes, what stays, and what touches."""
