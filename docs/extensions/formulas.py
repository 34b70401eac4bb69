# SPDX-License-Identifier: BSD-3-Clause
"""Formulas as MathML, written when the documentation is built: pages need neither a network nor a script for them."""

from docutils import nodes
from latex2mathml.converter import convert


def inline(translator, node):
    translator.body.append(convert(" ".join(node.astext().split())))
    raise nodes.SkipNode


def display(translator, node):
    formula = convert(" ".join(node.astext().split()), display="block")
    translator.body.append(f'<div class="formula">{formula}</div>\n')
    raise nodes.SkipNode


def setup(app):
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
