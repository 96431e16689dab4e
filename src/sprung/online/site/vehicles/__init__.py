"""A vehicle: main result, windows, trends, data quality, baseline, diagrams, report and tables."""
