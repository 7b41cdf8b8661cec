"""tolcontact new, tolcontact check, tolcontact view, tolcontact guide."""

import json
import re
import shlex
import tempfile
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import typer

from tolcontact.archive import open_archive
from tolcontact.cli import app as common
from tolcontact.cli.output import check_outputs
from tolcontact.cli.progress import waiting
from tolcontact.cli.step_files import without_annotations
from tolcontact.declaration import Assembly
from tolcontact.declaration.geometry import STEP
from tolcontact.declaration.script import load_model
from tolcontact.declaration.values import key_faults
from tolcontact.discretization import Nominal, discretize
from tolcontact.errors import ModelError, OptionError
from tolcontact.geometry import parts_from
from tolcontact.input_files import is_archive
from tolcontact.plausibility import drawing_remarks, elastic_remarks
from tolcontact.pmi import read_pmi
from tolcontact.pmi.declared import declared_file
from tolcontact.report import nominal_and_faults, write_guide, write_page, write_view
from tolcontact.workflow.accessor import summarize
from tolcontact.workflow.models import DEFAULT_SOLVER, build

PRESS = (
    "advice: pins or bolts stand in holes, and no force holds the parts together, so contact may lift or tilt them; declare "
    'what does (a weight, a clamp): assembly.force(...), with objective "seating"'
)
MODELS = (".py", ".json")
STARTERS = {False: Path(__file__).with_name("starter.py"), True: Path(__file__).with_name("stack_starter.py")}


@common.app.command(epilog=common.examples("new bracket", "new play --stack"))
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the model; its script is NAME.py.")],
    stack: Annotated[bool, common.flag("--stack", "Write a stack in one dimension, without parts.")] = False,
) -> None:
    """Write a small model with comments as a starting point."""
    path = Path(name if name.endswith(".py") else f"{name}.py")
    if faults := list(key_faults("model", [path.stem])):
        raise OptionError(faults[0])
    text = STARTERS[stack].read_text(encoding="utf-8")
    text = text.replace('("starter"', f"({json.dumps(path.stem)}").replace(" (NAME is this file without its ending)", "")
    text = re.sub(r"NAME\.\w+", lambda name: shlex.quote(name[0].replace("NAME", path.stem)), text)
    try:
        with path.open("x", encoding="utf-8") as file:
            try:
                file.write(text)
                file.flush()
            except BaseException:  # the disk may be full
                path.unlink()
                raise
    except FileExistsError as error:
        raise OptionError(f'"{path}" exists already, and was not changed; choose another name') from error
    except OSError as error:
        raise OptionError(f'"{path}" cannot be written: {error.strerror}') from error
    common.echo(f"model: {path}\nnext: tolcontact check {shlex.quote(str(path))}")


@common.app.command(epilog=common.examples("check model.py", "check model.py --view", "check part.stp --drawing"))
def check(
    model: common.Model,
    solver: common.Solver = DEFAULT_SOLVER,
    resolution: common.Resolution = None,
    objective: common.Objective = None,
    drawing: Annotated[bool, common.flag("--drawing", "Also say what the drawings leave open or take as perfect.")] = False,
    view: Annotated[bool, common.flag("--view", "Also open the page of `tolcontact view`, with marked faults.")] = False,
) -> None:
    """Check a model and its options without a run; list all faults and probable mistakes.

    With --drawing, MODEL may also be a STEP file of AP242, or a model that nothing locates or measures yet.
    """
    assembly, doubts = None, list[warnings.WarningMessage]()
    try:
        with waiting(f"checking {model}"), warnings.catch_warnings(record=True) as doubts:
            if model.suffix.lower() in STEP:
                _check_annotations(model, is_asked=drawing and not view)
                return
            assembly = load_model(model)
            program = build(assembly, solver=solver, method=common.method_choices(resolution=resolution, objective=objective))
        with waiting("solving elastic parts again, with finer meshes"), warnings.catch_warnings(record=True) as elastic_doubts:
            elastic = list(elastic_remarks(program))
            doubts += elastic_doubts
    except ModelError as error:
        common.show_warnings(doubts)
        if view and assembly is not None:
            _open_view(assembly, None, error.faults, model)
        if drawing and assembly is not None and (nominal := nominal_and_faults(assembly)[0]):
            _print_remarks(nominal)
        raise
    if view:
        _open_view(assembly, program.nominal, (), model)
    common.echo(program.nominal.assembly)
    for part in program.nominal.last_parts:
        size = " x ".join(f"{length:.4g}" for length in part.body.extents.round(9))
        common.echo(f"  part {part.name}: {size} mm along x, y, z of the assembly, {len(part.mesh.faces)} triangles")
    for line in (*program.elastic_parts_in_words, *(f"  {remark}" for remark in elastic)):
        common.echo(f"  {line}")
    for k, pair in enumerate(program.nominal.pairs):
        common.echo(f"  contact {pair.name}: {program.contact_in_words(k)}")
    for line in program.draws.in_words:
        common.echo(f"  {line}")
    if program.stored_coordinates:
        common.echo(f"  {program.stored_coordinates}")
    if not program.nominal.assembly.forces and not all(pair.stays.all() for pair in program.nominal.pairs):
        common.echo(f"  {PRESS}")
    if drawing:
        _print_remarks(program.nominal)
    common.show_warnings(doubts)
    count = {0: "", 1: ", 1 warning"}.get(len(doubts), f", {len(doubts)} warnings")
    common.echo(f"no faults found{count}")


def _check_annotations(file: Path, *, is_asked: bool) -> None:
    """Print what the tolerances of a STEP file leave open, and those among them that no feature states."""
    if not is_asked:
        raise OptionError(f'"{file}" is a STEP file; its tolerances are checked with the option --drawing alone')
    information = read_pmi(file)
    if information.is_empty:
        raise OptionError(without_annotations(information, file))
    declared = declared_file(file, information)
    common.echo(declared)
    if any(entry.reason for entry in declared.annotations):
        common.echo("drawing: what is not declared does not count here; it may limit what is said to be open")
    _print_remarks(discretize(declared.assembly, incomplete=True))


def _print_remarks(nominal: Nominal) -> None:
    """Print what the check of the drawings says of the parts."""
    remarks = list(drawing_remarks(nominal))
    for remark in remarks or ["nothing that the tolerances leave open"]:
        common.echo(f"drawing: {remark}")


def _open_view(assembly: Assembly, nominal: Nominal | None, faults: Sequence[str], model: Path) -> None:
    """Write the view of an assembly, and open it in the browser."""
    page = temporary_page(model)
    write_view(assembly, nominal, faults, page)
    _open_page(page)


def _open_page(page: Path) -> None:
    common.echo(f"page: {page}")
    typer.launch(str(page))


@common.app.command(epilog=common.examples("view model.py", "view parts.stp", "view model.py --out page.html"))
def view(
    source: Annotated[Path, typer.Argument(metavar="MODEL|FILE.nc|FILE.stp", help="A model, an archive, or a STEP file.")],
    out: Annotated[
        Path | None, typer.Option(metavar="FILE.html", help="Page to write. Default: a temporary page, opened in the browser.")
    ] = None,
    overwrite: common.Overwrite = False,
) -> None:
    """Show an assembly before a run: faces, features with their tolerances, locators, contact points and nominal gaps.

    The page lists the faults of a model, which may be incomplete: it needs no measurements. For an archive it is the report.
    """
    check_outputs([source], page=out, overwrite=overwrite)
    path = out.absolute() if out else temporary_page(source)  # a script may change the working folder
    with waiting(f"reading {source}"):
        if is_archive(source):
            with open_archive(source) as results:
                write_page(results, summarize(results), path)
        elif source.suffix.lower() in STEP:
            model = Assembly(source.stem)
            parts_from(model, source)
            write_view(model, None, [], path)
        elif source.is_file() and source.suffix.lower() not in MODELS:
            accepted = ", ".join((*MODELS, ".nc", *STEP))
            raise OptionError(f'"{source}" is not a name of what is shown; expected one that ends in {accepted}')
        else:
            model = load_model(source)
            write_view(model, *nominal_and_faults(model), path)
    common.echo(f"page: {out or path}")
    if out is None:
        typer.launch(str(path))


@common.app.command(epilog=common.examples("guide"))
def guide() -> None:
    """Open the installed guide in the browser: tutorials, how-tos, theory, reference, glossary."""
    _open_page(write_guide(temporary_page(Path("guide")).parent))


def temporary_page(source: Path) -> Path:
    """Return the path of a new page in a temporary folder."""
    return Path(tempfile.mkdtemp(prefix="tolcontact-")) / f"{source.stem}.html"
