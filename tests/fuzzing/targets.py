"""The table of targets: all functions of the package that read data which others may have written."""

from tests.fuzzing import of_folders, of_tables, of_texts
from tests.fuzzing.target import Target

TARGETS: dict[str, Target] = of_folders.TARGETS | of_tables.TARGETS | of_texts.TARGETS
