"""Results that show themselves in Python: the first screen, the figures and the tables of their report."""

from __future__ import annotations

from importlib import import_module
from io import StringIO
from typing import TYPE_CHECKING, Any, ClassVar

from ..errors import ConfigError
from ..quantities.text import SI, Units
from ..serialization import provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .content import ReportContent

WIDTH = 100  # columns of a first screen


class Presented:
    """A result with a report."""

    makers: ClassVar[tuple[str, ...]]
    """Module that makes the report, its function, and that of the document, where the report is made of one."""

    __slots__ = ()

    def report(self, units: Units = SI) -> ReportContent:
        """Return what the report of the result holds, in `units`."""
        name, content, *document = self.makers
        module = import_module(f"...{name}", __name__)
        subject = getattr(module, document[0])(self, provenance(log_sha256="")) if document else self
        made: ReportContent = getattr(module, content)(subject, units)
        return made

    def __repr__(self) -> str:
        """Return the first screen, as the command prints it."""
        from rich.console import Console

        from .terminal import print_screen

        text = StringIO()
        print_screen(self.report(), Console(file=text, width=WIDTH, color_system=None))
        return text.getvalue().rstrip()

    def _repr_html_(self) -> str:
        """Return the first screen and the tables, for a notebook."""
        from html import escape

        def row(tag: str, cells: tuple[str, ...]) -> str:
            return f"<tr>{''.join(f'<{tag}>{escape(cell)}</{tag}>' for cell in cells)}</tr>"

        parts = [f"<pre>{escape(repr(self))}</pre>"]
        for table in self.report().tables:
            rows = [row("th", table.heads), *(row("td", cells) for cells in table.rows)]
            parts.append(f"<table><caption>{escape(table.title)}</caption>{''.join(rows)}</table>")
        return "".join(parts)

    def plot(self, name: str = "", units: Units = SI) -> Figure:
        """Return a figure of the report, the first without a name.

        Raises
        ------
        ConfigError : the report has no figure of that name.
        """
        from .figures import draw

        drawings = {drawing.name: drawing for drawing in self.report(units).drawings}
        return draw(drawings[_known(name, drawings, "figure")])

    def to_dataframe(self, name: str = "") -> Any:
        """Return a table of the report at full precision, in SI, as a `pandas.DataFrame`; the first without a name.

        Raises
        ------
        ConfigError : the report has no table of that name, or pandas is not installed.
        """
        data = {file.removesuffix(".csv"): made for file, made in self.report().data.items()}
        made = data[_known(name, data, "table")]
        try:
            pandas = import_module("pandas")
        except ImportError:
            raise ConfigError("to_dataframe: pandas is not installed; pip install pandas") from None
        return pandas.DataFrame(dict(made() if callable(made) else made))


def _known(name: str, named: dict[str, Any], what: str) -> str:
    """Return a name that there is, the first for none."""
    wanted = name or next(iter(named), "")
    if wanted not in named:
        raise ConfigError(f"{what}: the report has no {name or what}; it has: {', '.join(named) or 'none'}")
    return wanted
