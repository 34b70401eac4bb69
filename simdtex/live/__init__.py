# SPDX-License-Identifier: BSD-3-Clause
"""The live page: a run is watched and steered while it goes on, in a browser or in a notebook.

`Session` is what a page talks to, whatever carries the messages: `simdtex.live.server` a WebSocket, and
`simdtex.live.widget` the connection of a notebook. The page itself is in ``page/``: one ES module, one style sheet.
"""
