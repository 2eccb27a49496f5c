"""Statics of a robot: tensions at one instant, equilibria, and the effect of geometric uncertainty."""
