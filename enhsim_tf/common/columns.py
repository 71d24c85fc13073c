"""Names of the user's columns in tables that also have columns of ours."""

from collections.abc import Collection, Sequence


def apart_from(
    ours: Collection[str], names: Sequence[str], what: str = "channel"
) -> dict[str, str]:
    """Returns the column of each of the user's names: the name itself, or if one of our columns or
    another of the user's is called so, the name followed by `(what)`, as often as it takes.
    """
    columns: dict[str, str] = {}
    taken = set(ours)
    for name in names:
        column = name
        while column in taken or (column != name and column in names):
            column += f" ({what})"
        columns[name] = column
        taken.add(column)
    return columns
