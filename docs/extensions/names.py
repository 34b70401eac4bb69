# SPDX-License-Identifier: BSD-3-Clause
"""Names that pages and docstrings mention: one with a page is linked, any other has to exist.

With Sphinx's `nitpicky`, whatever is neither is a warning, and so an error.
"""

from pkgutil import resolve_name


def known(app, env, node, shown):
    """The name as it stands, where it has no page: a parameter, or something within the package or another one."""
    name = node["reftarget"]
    if node["reftype"] != "obj":
        return None
    if "." not in name:
        return shown if name.isidentifier() else None
    module = node.get("py:module") or ""
    return shown if any(exists(full) for full in (name, f"{module}.{name}", f"simdtex.{name}")) else None


def exists(name):
    """Whether a dotted name leads to a module, to something in it, or to a field of a class."""
    try:
        resolve_name(name)
    except (ImportError, ValueError):
        return False
    except AttributeError:
        owner, _, field = name.rpartition(".")
        return owner.count(".") > 0 and exists(owner) and field in getattr(resolve_name(owner), "__annotations__", ())
    return True


def setup(app):
    app.connect("missing-reference", known, priority=900)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
