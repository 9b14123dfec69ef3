"""The reduced model of a case and its contact modes, in closed form."""
