"""Image files of a glTF scene: embedded in the buffer of a GLB where they can be read."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import quote, unquote

from ...base.text import list_some, plural, printable
from ...errors import ConeflatError
from ..attributes import MAX_NAME
from ..files import moved_path, read_bytes
from ..texture import image_kind
from .data import GltfData, Item
from .glb import Glb


def embed_images(glb: Glb, data: GltfData, folder: Path) -> None:
    """Embed image files in the buffer; for those that cannot be read, rewrite the relative paths."""
    for image in image_files(glb.tree):
        uri = image["uri"]
        content = _content_of(data, uri)
        kind = image_kind(content)
        if kind is None or kind == "image/gif":  # glTF does not support GIF
            source, target = (os.path.realpath(place) for place in (data.path.parent, folder))
            image["uri"] = quote(moved_path(os.fsencode(unquote(uri)), source, target))
            continue
        del image["uri"]
        image |= {"bufferView": glb.add_view(content), "mimeType": kind}


def image_files(tree: Item) -> Iterator[Item]:
    """Yield the images of a scene that are files of their own."""
    for image in tree.get("images", []):
        uri = image.get("uri")
        if isinstance(uri, str) and not uri.startswith("data:") and "://" not in uri:
            yield image


def _content_of(data: GltfData, uri: str) -> bytes:
    """Return the content of an image file; empty if it cannot be read, or is outside the folder of the scene."""
    try:
        return read_bytes(data.resolve(uri))
    except ConeflatError:
        return b""


def image_notes(data: GltfData) -> list[str]:
    """Return a note on image files of a scene that cannot be embedded, if there are any."""
    unread_images = [
        printable(image["uri"])[:MAX_NAME]
        for image in image_files(data.tree)
        if not _content_of(data, image["uri"])
    ]
    if not unread_images:
        return []
    return [
        f"{plural(len(unread_images), 'image file is', 'image files are')} not embedded, because nothing can be "
        f"read there, or because it is outside the folder of the scene: {list_some(unread_images)}."
    ]
