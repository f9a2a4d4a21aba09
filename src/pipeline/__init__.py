"""Generalising pouring between containers by warped parameters (Brandl, Kroemer and Peters, Humanoids 2014)."""
