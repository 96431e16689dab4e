"""The challenge: tasks, sealed truth, entries and scores, see `README.md`."""
