"""Text about the factorial experiment: its table for the report, and the last lines of the command."""

from enhsim_tf.reproduce.publish.wording import Findings, interval, points


def lines(found: Findings) -> list[str]:
    """The last lines that the command prints: how many cells there are, and the contributions for each generator."""
    said = [f"{found['num_cells']} of {found['of_cells']} cells"]
    for generator, about in found["shares"].items():
        closed = about["gap_closed"]
        parts = ", ".join(f"{factor} {points(each['share'])}" for factor, each in closed["factors"].items())
        said.append(f"{generator}: gap closed from {interval(closed['paper'])} to {interval(closed['switched'])}; points by {parts}")
    return said
