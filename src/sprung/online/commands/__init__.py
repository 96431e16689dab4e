"""Commands of the depot: boxes, the monitor, its store, alerts, vehicles, accounts."""

import typer

from sprung.online.commands import accounts, box, mcp, monitor, vehicles


def register(application: typer.Typer) -> None:
    """Add the commands to the application."""
    for command in (monitor.monitor, box.box, box.replay, vehicles.report, monitor.demo, mcp.mcp):
        application.command()(command)
    application.add_typer(vehicles.alerts_application, name="alerts")
    application.add_typer(vehicles.application, name="vehicles")
    application.add_typer(accounts.accounts_application, name="accounts")
    application.add_typer(accounts.tokens_application, name="tokens")
