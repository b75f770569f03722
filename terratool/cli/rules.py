"""`terratool rules`."""

from __future__ import annotations

import click

from terratool.definition.rules import all_rules


@click.command("rules", epilog="Example: terratool rules TT201")
@click.argument("code", required=False)
def command(code: str | None) -> None:
    """List the validator's rules, or explain the one with CODE."""
    rules = all_rules()
    if code is None:
        for rule in rules.values():
            click.echo(f"{rule.code}  {rule.severity:7}  {rule.name}")
        return
    if code.upper() not in rules:
        raise click.UsageError(f"No rule has the code {code}. Run terratool rules for the list.")
    rule = rules[code.upper()]
    click.echo(f"{rule.code} {rule.name} ({rule.severity})\n\n{rule.manual.replace('``', '')}")
