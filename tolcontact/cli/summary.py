"""tolcontact summary."""

from typing import Annotated

import typer

from tolcontact.archive import open_archive
from tolcontact.cli.app import Archive, app
from tolcontact.cli.output import print_data, print_summary
from tolcontact.errors import OptionError
from tolcontact.workflow.run import summarize


@app.command()
def summary(
    archive: Archive,
    as_json: Annotated[bool, typer.Option("--json", help="Print it as JSON.")] = False,
    as_csv: Annotated[bool, typer.Option("--csv", help="Print the estimates of the measures as CSV.")] = False,
) -> None:
    """Print the statistics of an archive."""
    if as_json and as_csv:
        raise OptionError("--json and --csv are both given; choose one")
    with open_archive(archive) as results:
        if as_csv:
            values = summarize(results)["statistic_value"].to_dataset("interval").to_dataframe()
            typer.echo(values[["estimate", "lower", "upper"]].to_csv(lineterminator="\n"), nl=False)
        elif as_json:
            print_data(summarize(results))
        else:
            print_summary(summarize(results))
