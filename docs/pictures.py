"""Draw the pictures of this folder: the figures that the commands below write, made small.

    python docs/pictures.py            write docs/pictures/*.png

The logs are those of `data/`, or simulated. A picture is the PNG of `--out`, narrowed and reduced to a palette.
"""

from __future__ import annotations

import os
import shlex
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image

ROOT = Path(__file__).resolve().parents[1]
PICTURES = ROOT / "docs" / "pictures"
WIDTH = 900  # pixels: what a Markdown page shows without scaling
COLOURS = 128  # a dozen colours and the smoothing of lines; fewer change a colour visibly

# A command, and the pictures made of its figures: name of the picture, name of the figure. "" makes logs only.
RUNS: tuple[tuple[str, dict[str, str]], ...] = (
    (
        "dictionary configs/thesis_dictionary.yaml data/citation_clean.h5",
        {name: name for name in ("signatures", "coherence", "limits")},
    ),
    (
        "identify data/citation_two_faults.h5 -d configs/thesis_dictionary.yaml",
        {name: name for name in ("outputs", "fault", "magnitudes", "residuals", "orders")},
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
)


def main() -> None:
    """Run the commands in a temporary folder and keep their figures."""
    PICTURES.mkdir(exist_ok=True)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for place in ("data", "configs"):
            (folder / place).symlink_to(ROOT / place)
        for i, (command, pictures) in enumerate(RUNS):
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


def shrink(figure: Path, picture: Path) -> None:
    """Write a figure at the width of a page, with few colours."""
    with Image.open(figure) as drawn:
        size = (WIDTH, round(drawn.height * WIDTH / drawn.width))
        page = drawn.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    page.quantize(COLOURS, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE).save(picture, optimize=True)
    print(f"{picture.relative_to(ROOT)}: {picture.stat().st_size // 1000} kB")


if __name__ == "__main__":
    main()
