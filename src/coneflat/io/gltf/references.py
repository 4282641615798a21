"""The arrays and objects that a glTF tree refers to, in addition to those of the mesh.

A written file keeps all of them, including extensions, but not arrays that are no longer referred to.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from .data import GltfData, Item

#: Keys in extensions whose values are indices of objects other than arrays.
_NO_ARRAYS = ("index", "texCoord", "source", "sampler", "material", "light", "node", "mesh", "variants")
_LISTS = (
    "accessors", "bufferViews", "images", "materials", "meshes", "nodes", "textures", "skins", "animations",
)  # fmt: skip


def check_references(data: GltfData) -> None:
    """Raise an error for a tree that could not be written again, because a reference or a type in it is invalid.

    Raises:
        MeshFileError, KeyError, TypeError, AttributeError: depending on the invalid part.
    """
    for name in _LISTS:
        for i, item in enumerate(data.items(name)):
            data.entry(item, "extensions", dict)
            if name == "bufferViews":
                data.view(i)
            elif name == "meshes":
                data.entry(item, "primitives", list)
            elif name == "nodes" and "mesh" in item:
                data.item("meshes", item["mesh"])
    for name in ("extensionsUsed", "extensionsRequired"):
        data.entry(data.tree, name, list)
    for name, index in _references(data):
        data.item(name, index)
    for accessor in accessors_of_arrays(data.tree):
        for owner in view_owners(data.item("accessors", accessor)):
            data.view(owner["bufferView"])
    for view in views_of_images(data.tree):
        data.view(view)


def _references(data: GltfData) -> Iterator[tuple[str, Any]]:
    """Yield the list and the index of each object other than an array that scenes, nodes, meshes and so on refer to."""
    tree, entry = data.tree, data.entry
    if "scene" in tree:
        yield "scenes", tree["scene"]
    singles = {
        "nodes": {"mesh": "meshes", "skin": "skins", "camera": "cameras"},
        "textures": {"source": "images", "sampler": "samplers"},
        "skins": {"skeleton": "nodes"},
    }
    for kind, names in singles.items():
        for item in entry(tree, kind, list):
            yield from ((to, item[name]) for name, to in names.items() if name in item)
    for kind, name in (("scenes", "nodes"), ("nodes", "children"), ("skins", "joints")):
        for item in entry(tree, kind, list):
            yield from (("nodes", node) for node in entry(item, name, list))
    for mesh in entry(tree, "meshes", list):
        yield from (
            ("materials", primitive["material"])
            for primitive in mesh["primitives"]
            if "material" in primitive
        )


def accessors_of_arrays(tree: Item) -> Iterator[int]:
    """Yield the accessors that meshes, skins and animations refer to."""
    for mesh in tree.get("meshes", []):
        for primitive in mesh["primitives"]:
            yield from primitive.get("attributes", {}).values()
            if "indices" in primitive:
                yield primitive["indices"]
            for target in primitive.get("targets", []):
                yield from target.values()
    for skin in tree.get("skins", []):
        if "inverseBindMatrices" in skin:
            yield skin["inverseBindMatrices"]
    for animation in tree.get("animations", []):
        for sampler in animation.get("samplers", []):
            yield from (sampler[name] for name in ("input", "output") if name in sampler)


def views_of_images(tree: Item) -> Iterator[int]:
    """Yield the buffer views of images."""
    return (image["bufferView"] for image in tree.get("images", []) if "bufferView" in image)


def view_owners(accessor: Item) -> list[Item]:
    """Return the parts of an accessor that have a buffer view."""
    sparse = accessor.get("sparse", {})
    parts = (accessor, sparse.get("indices", {}), sparse.get("values", {}))
    return [part for part in parts if "bufferView" in part]


def numbers_in_extensions(tree: Any) -> Iterator[int]:
    """Yield all integers in extensions, some of which may be indices of arrays or buffer views."""
    stack = [(tree, False)]
    while stack:
        item, is_inside = stack.pop()
        if isinstance(item, dict):
            entries = ((key, value) for key, value in item.items() if key not in _NO_ARRAYS)
            stack += [(value, is_inside or key == "extensions") for key, value in entries]
        elif isinstance(item, list):
            stack += [(value, is_inside) for value in item]
        elif is_inside and isinstance(item, int):
            yield item


def keys_of(item: Any) -> Iterator[str]:
    """Yield all keys of an object and of nested objects."""
    return (key for key, _ in entries_of(item))


def entries_of(item: Any) -> Iterator[tuple[str, Any]]:
    """Yield all keys with their values of an object and of nested objects."""
    stack = [item]
    while stack:
        item = stack.pop()
        if isinstance(item, dict):
            yield from item.items()
            stack += item.values()
        elif isinstance(item, list):
            stack += item
