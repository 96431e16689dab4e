"""Archives and streams of many vehicles on Spark."""
