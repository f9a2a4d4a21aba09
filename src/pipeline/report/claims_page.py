"""The page of the paper's claims: its words, our number with its interval, whether it holds, and why where it does not."""

from typing import TYPE_CHECKING

from pipeline.report.evaluation_pages import A4, SMALL

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure


NOTE = (
    "Intervals are a bootstrap's over objects; not sure: the interval has both answers. Areas nearer than 0.01 count as alike.\n"
    "Section IV-B, the robot: reports/execution.pdf, where there are demonstrations."
)


def claims_page(claims: "pd.DataFrame", note: str = NOTE) -> "Figure":
    """Return the page of the paper's claims as a table; `note` stands below."""
    import textwrap

    import matplotlib.pyplot as plt

    with plt.rc_context(SMALL):
        figure = plt.figure(figsize=A4)
        figure.suptitle("The paper's claims", y=0.975, fontsize=10)
        columns = {
            "the paper says": 0.05,
            "here": 0.35,
            "95 % interval": 0.58,
            "holds": 0.69,
            "why, where it does not": 0.76,
        }
        y = 0.945
        for word, x in columns.items():
            figure.text(x, y, word, weight="bold", fontsize=7)
        y -= 0.018
        for row in claims.itertuples():
            holds = ("yes" if row.holds else "no") + ("" if row.sure else " (not sure)")
            cells = [
                (0.05, textwrap.wrap(f"{row.section}: {row.words}", 50)),
                (0.35, [*textwrap.wrap(row.measure, 38), _signed(row.value)]),
                (0.58, [f"{_signed(row.low)} to", _signed(row.high)] if row.low != row.high else ["–"]),
                (0.69, textwrap.wrap(holds, 11)),
                (0.76, textwrap.wrap(row.why, 38)),
            ]
            for x, lines in cells:
                figure.text(x, y, "\n".join(lines), fontsize=6, va="top", linespacing=1.2)
            y -= 0.0108 * max(len(lines) for _, lines in cells) + 0.010
            figure.add_artist(plt.Line2D([0.05, 0.97], [y + 0.005] * 2, lw=0.3, color="#BBBBBB"))
        figure.text(0.05, y - 0.012, note, fontsize=6.5, va="top")
    return figure


def _signed(value: float) -> str:
    return f"{value:.4f}".replace("-", "−")
