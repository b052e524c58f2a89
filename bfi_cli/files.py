"""The files that a command writes: no file of the user is lost, and each file is replaced whole or not at all."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path

from .errors import ConfigError, reason_of

# Marks of a file of this program: the first line of a CSV file, an attribute of the root of an HDF5 file, the library
# of an MCAP file (its second string, after an empty one and 9 bytes of the head of the record), the kind and the
# provenance of a JSON document.
MARK = "# written by bfi"
# First line of a list of events, for programs that take the first line of a CSV file for its header.
EVENTS = "time,end,event,channels,state,kind,shape,magnitude,unit,low,high,p_value"
ATTRIBUTE, OWNER = "written_by", "bfi"
KIND = re.compile(
    rb'"kind"\s*:\s*"(?:calibration|compare|detect|diagnosability|diagnose|dictionary|fleet|identify|info|montecarlo|plot'
    rb'|reproduce|start-time|unread)"'
)
PROVENANCE = re.compile(rb'"provenance"\s*:\s*\{')
# Our documents begin with their kind and end with their provenance; the series between may be gigabytes long.
END_BYTES = 65_536
HDF5 = b"\x89HDF\r\n\x1a\n"
MCAP = b"\x89MCAP0\r\n"
# Documents that mark a folder of results, and are moved into it last.
DOCUMENTS = ("result.json", "summary.json")
# The page of a result ends with a list of the files written with it, so that a later result can remove them.
REPORT, LIST = "report.html", re.compile(rb"<!-- bfi wrote (\{.*\}) -->\s*\Z")


def is_ours(path: Path) -> bool:
    """Say whether a file has the mark of this program."""
    try:
        with path.open("rb") as file:
            head = file.read(END_BYTES)
            file.seek(max(0, path.stat().st_size - END_BYTES))
            tail = file.read()
    except OSError:
        return False
    if head.startswith(HDF5):
        import h5py

        try:
            with h5py.File(path, "r") as file:
                return bool(file.attrs.get(ATTRIBUTE) == OWNER)
        except Exception:  # a damaged file can make the HDF5 library raise anything
            return False
    if head.startswith(MCAP):
        return head[len(MCAP) + 17 :].startswith(OWNER.encode())
    if head.lstrip()[:1] == b"{":
        return all(words.search(head) or words.search(tail) for words in (KIND, PROVENANCE))
    return head.removeprefix(b"\xef\xbb\xbf").splitlines()[:1] in ([MARK.encode()], [EVENTS.encode()])


def list_of_files(files: Mapping[str, bytes]) -> bytes:
    """Return the comment that ends the page of a result: every file beside it by name, and the digest of its bytes."""
    digests = {name: hashlib.sha256(content).hexdigest() for name, content in files.items()}
    return f"<!-- bfi wrote {json.dumps(digests).replace('--', '')} -->\n".encode()


def _left_over(folder: Path, names: Iterable[str], inputs: Sequence[str | Path]) -> list[Path]:
    """Return the unchanged files of an earlier result that are not among `names`."""
    try:
        match = LIST.search((folder / REPORT).read_bytes())
        digests = json.loads(match[1]) if match else {}
    except (OSError, ValueError):
        return []
    old = [folder / name for name in digests if Path(name).name == name and name not in {*names}]
    return [
        path
        for path in old
        if path.is_file() and not path.is_symlink() and not any(same_file(path, input_path) for input_path in inputs)
        if hashlib.sha256(path.read_bytes()).hexdigest() == digests[path.name]
    ]


def same_file(path: str | Path, other: str | Path) -> bool:
    """Say whether two paths name one existing file: another spelling, a symbolic or a hard link."""
    try:
        return os.path.samefile(path, other)
    except (OSError, ValueError):
        return False


def check_files(
    paths: Iterable[Path], *, inputs: Sequence[str | Path] = (), force: bool = False, option: str = "--output"
) -> None:
    """Check that files may be written, without writing.

    Parameters
    ----------
    inputs : files that the command reads, which are never replaced.
    force : replace files that this program did not write.
    option : that names the files, for messages.

    Raises
    ------
    ConfigError : a file is an input, is not ours, or cannot be written.
    """
    for path in paths:
        reason = ""
        if any(same_file(path, input_path) for input_path in inputs):
            reason = f"is an input of this command; give another {option}"
        elif obstacle := _obstacle(path):
            reason = f"cannot be written, {obstacle}; give another {option}"
        elif not force and os.path.lexists(path) and not is_ours(path):
            reason = f"exists and was not written by bfi; give another {option}, or --force to replace it"
        if reason:
            raise ConfigError(f"{path}: {reason}")


def check_folder(folder: Path, names: Iterable[str], *, inputs: Sequence[str | Path] = (), force: bool = False) -> None:
    """Check that files may be written to a folder of --out; every file of a folder of results is ours.

    Raises
    ------
    ConfigError : see `check_files`.
    """
    if reason := _obstacle(folder / "file"):
        raise ConfigError(f"{folder}: cannot be written, {reason}; give another --out")
    ours = any(is_ours(folder / name) for name in DOCUMENTS)
    check_files((folder / name for name in names), inputs=inputs, force=force or ours, option="--out")


def _obstacle(path: Path) -> str | None:
    """Return why no file can be written at a path, None where it can, as far as can be told without writing."""
    if os.path.lexists(path) and not path.is_symlink() and not path.is_file():
        return "is a directory" if path.is_dir() else "is no plain file"
    if path.is_file() and not os.access(path, os.W_OK):
        return "is read-only"
    above = next(parent for parent in path.absolute().parents if os.path.lexists(parent))
    if not above.is_dir():
        return "not a directory"
    return None if os.access(above, os.W_OK | os.X_OK) else "permission denied"


def replace_files(
    files: Mapping[str, bytes], folder: Path, *, inputs: Sequence[str | Path] = (), force: bool = False
) -> tuple[Path, ...]:
    """Check that files may be written to a folder of --out, then write all of them: see `check_folder` and `aside`.

    Files of an earlier result that are not replaced are removed; other files stay.

    Raises
    ------
    ConfigError : a file may not be replaced, or the folder cannot be made or written to; nothing is written then.
    """
    check_folder(folder, files, inputs=inputs, force=force)
    left_over = _left_over(folder, files, inputs) if REPORT in files else []
    with aside(folder, place=folder, option="--out") as new:
        for name, content in files.items():
            (new / name).write_bytes(content)
    for path in left_over:
        with contextlib.suppress(OSError):
            path.unlink()
    return tuple(folder / name for name in files)


@contextlib.contextmanager
def aside(folder: Path, *, place: Path, option: str) -> Iterator[Path]:
    """Yield an empty folder; the files in it are moved into `folder` when the block ends, none if it fails.

    Missing folders are made, and removed again after a failure. A new file has the mode of the file that it replaces.

    Parameters
    ----------
    place, option : the file or folder to write and the option that names it, for messages.

    Raises
    ------
    ConfigError : the folder cannot be made or written to.
    """
    import shutil
    import tempfile

    made = [path for path in (folder, *folder.parents) if not path.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=".bfi-", dir=folder, ignore_cleanup_errors=True) as new:
            yield Path(new)
            names = sorted(os.listdir(new), key=lambda name: (name in DOCUMENTS, name))
            for name in names:
                if (folder / name).exists():
                    shutil.copymode(folder / name, Path(new) / name)
            # An interruption waits until all files are moved, so that a result is never half old and half new.
            try:
                for name in names:
                    os.replace(Path(new) / name, folder / name)
            except KeyboardInterrupt:
                for name in names:
                    if (Path(new) / name).exists():
                        os.replace(Path(new) / name, folder / name)
                raise
    except BaseException as error:
        for new_folder in made:
            with contextlib.suppress(OSError):
                new_folder.rmdir()
        if isinstance(error, OSError):
            raise ConfigError(f"{place}: cannot be written, {reason_of(error)}; give another {option}") from error
        raise
