"""Alerts: their list with the precision of the site, the evidence behind one, and the actions on it."""
