"""Vehicles of a general multibody engine (MuJoCo): a truth that does not share the model of this package."""
