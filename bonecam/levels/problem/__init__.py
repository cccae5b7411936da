"""The program of one level: discretisation, energies and limits."""
