"""``graspdb validate``: estimates against measurements, one module for each kind."""

import typer

from graspdb.commands.validate_contact_map import contact_map
from graspdb.commands.validate_contacts import contacts
from graspdb.commands.validate_markers import markers

validate = typer.Typer(
    name="validate",
    help="Compare what is computed with measurements of the same thing.",
    rich_markup_mode=None,
    no_args_is_help=True,
)
validate.command()(contacts)
validate.command()(markers)
validate.command("contact-map")(contact_map)
