"""The product at a depot: boxes on vehicles, the store, alerts, the monitor with its pages, a demonstration."""
