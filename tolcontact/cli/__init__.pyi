from . import (
    analysis_command as analysis_command,
    app as app,
    archives as archives,
    compare as compare,
    models as models,
    run as run,
    step_files as step_files,
)
from .app import command_line as command_line, main as main
