# SPDX-License-Identifier: BSD-3-Clause
"""``python -m simdtex`` is the command ``simdtex``: both begin here, so that Ctrl-C ends also their imports quietly."""


def main() -> None:
    """Run the command line; Ctrl-C ends it with exit code 130 from the first import on."""
    import os
    import sys

    def leave(*_: object) -> None:
        os.write(2, b"simdtex: stopped\n")
        os._exit(130)  # an exception could be caught, or told with its traceback, by whatever is being imported

    try:
        import signal

        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else whoever started us ignores it
            signal.signal(signal.SIGINT, leave)  # until a command begins: simdtex.cli.ending
        from simdtex.cli import main as command

        command()
    except KeyboardInterrupt:
        sys.exit(130)


if __name__ == "__main__":
    main()
