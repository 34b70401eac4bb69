# SPDX-License-Identifier: BSD-3-Clause
"""Formulas as MathML, written when the documentation is built: pages need neither a network nor a script for them."""

import re

from docutils import nodes
from latex2mathml.converter import convert

BARS = re.compile(r"<mo([^>]*)>(\||&#x0007C;|&#x02016;)</mo>")


def mathml(node, **options):
    """The formula of a node; bars around a term stand close to it, as no operators do."""
    formula = convert(" ".join(node.astext().split()), **options)
    return BARS.sub(r'<mo\1 lspace="0.05em" rspace="0.05em">\2</mo>', formula)


def inline(translator, node):
    translator.body.append(mathml(node))
    raise nodes.SkipNode


def display(translator, node):
    translator.body.append(f'<div class="formula">{mathml(node, display="block")}</div>\n')
    raise nodes.SkipNode


def setup(app):
    app.add_html_math_renderer("mathml", (inline, None), (display, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
