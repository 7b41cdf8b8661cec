"""tolcontact summary."""

from tolcontact.archive import open_archive
from tolcontact.cli.app import Archive, app
from tolcontact.cli.output import print_summary


@app.command()
def summary(archive: Archive) -> None:
    """Print the statistics of an archive."""
    with open_archive(archive) as results:
        print_summary(results)
