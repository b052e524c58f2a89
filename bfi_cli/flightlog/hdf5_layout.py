"""What an HDF5 file holds itself, told apart before it is read: links, storage, kinds and sizes of datasets.

h5py's own look-ups (`in`, `get`, `[]`) follow every link, also into other files; here links are read as links first.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import LogError
from .raw import is_signal, require_few, unfit_kind

if TYPE_CHECKING:
    import h5py

__all__ = ["attribute", "is_text", "member", "members", "require_readable", "text", "unfit"]

MOST_LINKS = 100  # followed for one name; a log needs one or two, a loop never ends
MOST_PACKED = 1032  # deflate, the tightest of HDF5's usual filters, packs at most as many bytes into one
LARGEST_CHUNK = 2**28  # bytes; a chunk is unpacked whole, and is below 1 MiB where h5py or MATLAB choose its size
LARGEST_ATTRIBUTE = 2**24  # bytes; a unit takes ten, a list of a thousand segments 100 000
OWN_DATA = "a log must hold its own data, copy it into the file"


def members(path: str, node: h5py.Group, inside: tuple[h5py.Group, ...] = ()) -> Iterator[tuple[str, Any]]:
    """Yield name and object of everything in a group that lies inside the groups `inside`.

    Raises
    ------
    LogError : one of them lies in another file or nowhere, or is a group around itself.
    """
    require_few(path, len(node), "members of a group")
    for name in node:
        yield name, member(path, node, name, inside)


def member(path: str, node: h5py.Group, name: str, inside: tuple[h5py.Group, ...] = ()) -> Any:
    """Return what stands under a name of a group, None where there is nothing.

    Raises
    ------
    LogError : as `members`.
    """
    import h5py

    found = _followed(path, node, name, [])
    if isinstance(found, h5py.Group) and any(found == group for group in (node, *inside)):
        raise LogError(f"{path}: '{name}' is a group that holds itself; take the link out of the file")
    return found


def _followed(path: str, node: h5py.Group, name: str, trail: list[str]) -> Any:
    """Return what stands under a name; `trail` is the names of the soft links on the way to it."""
    import h5py

    key, links = name.encode("utf-8", "surrogateescape"), node.id.links
    if not links.exists(key):
        return None
    asked, kind = (trail or [name])[0], links.get_info(key).type
    if kind == h5py.h5l.TYPE_HARD:
        found = node[name]
        if isinstance(found, h5py.Dataset):
            _require_own(path, asked, found)
        return found
    if kind == h5py.h5l.TYPE_EXTERNAL:
        other = ":".join(part.decode("utf-8", "replace") for part in links.get_val(key))
        raise LogError(f"{path}: '{asked}' is an external link to '{other}'; {OWN_DATA}")
    if kind != h5py.h5l.TYPE_SOFT:
        raise LogError(f"{path}: '{asked}' is a link of another program's kind; {OWN_DATA}")
    trail.append(name)
    target = links.get_val(key).decode("utf-8", "surrogateescape")
    if len(trail) > MOST_LINKS:
        raise LogError(f"{path}: '{asked}' is a loop of soft links, got one to '{target}'; {OWN_DATA}")
    here: Any = node.file if target.startswith("/") else node
    for part in target.split("/"):
        if part not in ("", "."):
            here = _followed(path, here, part, trail) if isinstance(here, h5py.Group) else None
    if here is None:
        raise LogError(f"{path}: '{asked}' is a soft link to '{target}', which is not in the file; {OWN_DATA}")
    return here


def _require_own(path: str, name: str, data: h5py.Dataset) -> None:
    import h5py

    made = data.id.get_create_plist()
    if made.get_layout() == h5py.h5d.VIRTUAL:
        other = made.get_virtual_filename(0) if made.get_virtual_count() else "nothing"
        raise LogError(f"{path}: '{name}' is a virtual dataset of '{other}'; {OWN_DATA}")
    if made.get_external_count():
        other = made.get_external(0)[0].decode("utf-8", "replace")
        raise LogError(f"{path}: '{name}' keeps its values in another file, '{other}'; {OWN_DATA}")


def unfit(child: Any) -> str | None:
    """Return why a dataset, or a struct in its place, is no signal, None where it is one."""
    import h5py

    if "MATLAB_sparse" in child.attrs:
        return "is a sparse matrix"
    if "MATLAB_empty" in child.attrs or child.shape is None or 0 in child.shape:
        return "is empty"
    if text(attribute(child, "MATLAB_class")) == "cell":
        return "is a cell array"
    try:
        dtype = child.dtype
    except TypeError:
        return "holds no numbers (a type of its own)"
    if is_text(child):
        return "holds text"
    if h5py.check_vlen_dtype(dtype) is not None:
        return "is ragged (rows of different length)"
    if dtype.kind == "c" or dtype.names == ("real", "imag"):
        return "holds complex numbers"
    if dtype.names:
        return f"is a table of named columns ({', '.join(dtype.names[:5])})"
    if h5py.check_ref_dtype(dtype):
        return "holds references, no numbers"
    return None if dtype.kind in "fiub" and is_signal(child.shape) else unfit_kind(dtype.kind, child.shape)


def is_text(data: h5py.Dataset) -> bool:
    """Say whether a dataset holds text, also that of MATLAB, which is numbers."""
    import h5py

    return (
        h5py.check_string_dtype(data.dtype) is not None
        or data.dtype.kind == "S"
        or text(attribute(data, "MATLAB_class")) == "char"
    )


def require_readable(path: str, name: str, data: h5py.Dataset) -> None:
    """Check that a dataset can hold what it claims, and that a part of it can be read without the whole.

    Raises
    ------
    LogError : it cannot.
    """
    chunk = int(np.prod(data.chunks or (0,), dtype=object)) * data.dtype.itemsize
    if chunk > LARGEST_CHUNK:
        raise LogError(
            f"{path}: '{name}' is stored in chunks of {chunk / 1e9:.2g} GB, the limit is "
            f"{LARGEST_CHUNK / 1e9:.2g} GB; store it in smaller ones (h5repack does)"
        )
    stored = data.id.get_storage_size()
    if data.nbytes > MOST_PACKED * stored:
        raise LogError(
            f"{path}: '{name}' claims {data.size} samples, more than its {stored} bytes in the file can hold; "
            "export it again"
        )


def attribute(node: Any, name: str) -> str | bytes | float | np.number[Any] | None:
    """Return the first value of an attribute, None where there is none or it is neither text nor a number."""
    if name not in node.attrs:
        return None
    try:
        if node.attrs.get_id(name).get_storage_size() > LARGEST_ATTRIBUTE:
            return None
        value = np.ravel(node.attrs[name])
    except (TypeError, ValueError, RuntimeError):  # empty, or of a type that numpy does not have
        return None
    first = value[0] if value.size else None
    return first if isinstance(first, str | bytes | int | float | np.number) else None


def text(value: str | bytes | float | np.number[Any] | None) -> str:
    """Return an attribute as text, "" where there is none."""
    if isinstance(value, bytes):
        return value.decode("utf-8", errors="replace")
    return "" if value is None else str(value)
