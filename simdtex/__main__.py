# SPDX-License-Identifier: BSD-3-Clause
"""``python -m simdtex`` and the command ``simdtex`` begin here, so that Ctrl-C during imports ends in one line."""


def main() -> None:
    """Run the command line; Ctrl-C ends it with exit code 130 from the first import on."""
    import os
    import sys

    def leave(*_: object) -> None:
        os.write(2, b"simdtex: stopped\n")
        os._exit(130)  # a module that is being imported could catch an exception, or print its traceback

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
