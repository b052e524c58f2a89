"""Draw the pictures of this folder: the figures that the commands below write, made small.

    python docs/pictures.py            write docs/pictures/*.png, and the section of validation.md that a run draws
    python docs/pictures.py NAME...    only those

The logs are those of `data/`, or simulated. A picture is the PNG of `--out`, narrowed and reduced to a palette. The run
of `sparsity` takes half an hour.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
VALIDATION = ROOT / "docs" / "validation.md"
WIDTH = 900  # pixels: what a Markdown page shows without scaling
COLOURS = 128  # a dozen colours and the smoothing of lines; fewer change a colour visibly

# A command, and the pictures made of its figures: name of the picture, name of the figure. "" makes logs only.
RUNS: tuple[tuple[str, dict[str, str]], ...] = (
    ("plot data/citation_two_faults.h5 --channel tas --channel pitch --channel elevator", {"plot": "channels"}),
    (
        "dictionary configs/thesis_dictionary.yaml data/citation_clean.h5",
        {name: name for name in ("signatures", "coherence", "limits")},
    ),
    (
        "identify data/citation_two_faults.h5 -d configs/thesis_dictionary.yaml",
        {name: name for name in ("hidden", "outputs", "fault", "magnitudes", "residuals", "orders")},
    ),
    ("start-time data/citation_bias.csv --rate 10 --order 4", {"onset_profile": "profile", "onset_outputs": "outputs"}),
    (
        "simulate b747 -o b747.h5 --duration 20 --noise aoa=0.0005 --noise pitch=0.0005 --noise pitch_rate=0.0002",
        {},
    ),
    ("inject b747.h5 --fault bias,channel=aoa,magnitude=0.005,onset_s=14 -o b747_fault.h5", {}),
    ("detect b747_fault.h5 --train 0:8", {"detection": "detection"}),
    (
        "diagnosability --model citation --noise tas=0.02 -d configs/thesis_dictionary.yaml --draws 2",
        {"divergence": "divergence", "information": "information", "manoeuvres": "manoeuvres"},
    ),
    (
        "montecarlo -c configs/montecarlo_noise.yaml --trials 20 --workers 2",
        {"montecarlo_isolation": "isolation", "montecarlo_error": "magnitude_error"},
    ),
    ("reproduce thesis-5-5", {"reproduced": "thesis_5_5"}),
    ("reproduce sparsity", {"sparsity": "sparsity", "sparsity_time": "sparsity_time"}),
)


def main() -> None:
    """Run the commands in a temporary folder and keep their figures."""
    wanted = set(sys.argv[1:])
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for place in ("data", "configs"):
            (folder / place).symlink_to(ROOT / place)
        for i, (command, pictures) in enumerate(RUNS):
            if wanted and pictures and not wanted & set(pictures):
                continue
            out = ["--out", f"out{i}"] if pictures else []
            subprocess.run(
                [sys.executable, "-m", "bfi_cli", *shlex.split(command), *out],
                cwd=folder,
                check=True,
                stdout=subprocess.DEVNULL,
                env={**os.environ, "PYTHONPATH": str(ROOT), "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
            )
            for picture, figure in pictures.items():
                shrink(folder / f"out{i}" / f"{figure}.png", PICTURES / f"{picture}.png")
            if "sparsity" in pictures:
                document = json.loads((folder / f"out{i}" / "result.json").read_text("utf-8"))
                text = VALIDATION.read_text("utf-8")
                VALIDATION.write_text(with_sparsity(text, document["exhibit"]), encoding="utf-8")


def shrink(figure: Path, picture: Path) -> None:
    """Write a figure at the width of a page, with few colours."""
    with Image.open(figure) as drawn:
        size = (WIDTH, round(drawn.height * WIDTH / drawn.width))
        page = drawn.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    page.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(picture, optimize=True)
    print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size // 1000} kB")


def with_sparsity(text: str, content: dict[str, Any]) -> str:
    """Return validation.md with what stands between `<!-- made: sparsity -->` and `<!-- end -->` of a new run."""
    before, start, rest = text.partition("<!-- made: sparsity -->\n")
    _, end, after = rest.partition("<!-- end -->")
    if not end:
        raise SystemExit("validation.md: no place for the section on sparsity")
    return f"{before}{start}\n{sparsity_section(content)}\n{end}{after}"


def sparsity_section(content: dict[str, Any]) -> str:
    """Return the answer on sparsity: a row per point and a column per rule, what each rule is, the trials."""
    cells = next(table["rows"] for table in content["tables"] if table["name"] == "rates")
    points, rules = (list(dict.fromkeys(row[i] for row in cells)) for i in (0, 1))
    facts = dict(content["facts"])

    isolated = {(row[0], row[1]): row[2] for row in cells}
    lines = [["atoms, noise", *rules], ["---"] * (len(rules) + 1)]
    lines += [[point, *(isolated[point, rule] for rule in rules)] for point in points]

    def shown(title: str, picture: str, drawing: dict[str, Any]) -> list[str]:
        return [f"### {title}", f"![{title}]({PICTURES.name}/{picture}.png)", drawing["caption"]]

    said = [f"- **{name}**: {facts[name]}." for name in rules]
    settings = [f"- {name}: {text}." for name, text in facts.items() if name not in (*rules, "Points")]
    parts = [
        content["verdict"],
        *shown("Isolated [%], 95 % Wilson intervals", "sparsity", content["drawings"][0]),
        "\n".join("| " + " | ".join(line) + " |" for line in lines),
        *shown("Processor time [ms], median", "sparsity_time", content["drawings"][1]),
        "### The rules",
        "\n".join(said),
        "### The trials",
        "\n".join(settings),
        *content["notes"],
        "Made by `python docs/pictures.py sparsity` from `bfi reproduce sparsity`.",
    ]
    return "\n\n".join(parts) + "\n"


if __name__ == "__main__":
    main()
