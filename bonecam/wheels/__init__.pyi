from .blading import blades as blades
