from .journal import locked_archive as locked_archive
from .reader import (
    check_rows as check_rows,
    open_archive as open_archive,
    open_unchecked as open_unchecked,
    opened as opened,
)
from .rows import (
    Row as Row,
    bytes_of_rows as bytes_of_rows,
    kept_rows as kept_rows,
    row_values as row_values,
    size_in_words as size_in_words,
)
from .settings import Run as Run, run_settings as run_settings
from .stored_model import method_of_run as method_of_run, model_of as model_of
from .variables import labelled as labelled, sizes_of_rows as sizes_of_rows
from .writer import (
    ArchiveWriter as ArchiveWriter,
    check_room_for as check_room_for,
    keep as keep,
    replacing_archive as replacing_archive,
)
