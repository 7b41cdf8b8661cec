"""tolcontact new."""

import json
from pathlib import Path
from typing import Annotated

import typer

from tolcontact.cli.app import app, examples
from tolcontact.declaration.names import key_faults
from tolcontact.errors import OptionError, shown

STARTER = Path(__file__).with_name("starter.py")


@app.command(epilog=examples("new bracket"))
def new(name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the model; its script is NAME.py.")]) -> None:
    """Write a small model with comments as a starting point."""
    path = Path(name if name.endswith(".py") else f"{name}.py")
    if faults := list(key_faults("model", [path.stem])):
        raise OptionError(faults[0])
    text = STARTER.read_text(encoding="utf-8")
    text = text.replace('tc.Assembly("starter")', f"tc.Assembly({json.dumps(path.stem)})").replace("NAME.", f"{path.stem}.")
    text = text.replace(" (NAME is this file without its ending)", "")
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise OptionError(f'"{path}" exists already, and was not changed; choose another name') from error
    except OSError as error:
        raise OptionError(f'"{path}" cannot be written: {error.strerror}') from error
    typer.echo(f"model: {shown(str(path))}\nnext: tolcontact check {shown(str(path))}")
