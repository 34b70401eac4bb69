# SPDX-License-Identifier: BSD-3-Clause
"""``python -m simdtex`` and the command ``simdtex`` begin here, so that Ctrl-C during imports ends in one line."""


def main() -> None:
    """Run the command line; Ctrl-C ends it with exit code 130 from the first import on."""
    import os
    import sys

    for name in ("stdin", "stdout", "stderr"):
        if getattr(sys, name) is None:  # it was closed, and the next file to be opened would get its number
            setattr(sys, name, open(os.devnull, "r+"))  # noqa: SIM115 - for the whole process
    if getattr(sys.stdout, "errors", "") == "strict":  # the name of a file may be no text
        sys.stdout.reconfigure(errors="backslashreplace")  # type: ignore[union-attr]

    def leave(*_: object) -> None:
        os.write(2, b"simdtex: stopped\n")
        os._exit(130)  # a module that is being imported could catch an exception, or print its traceback

    try:
        import signal

        if signal.getsignal(signal.SIGINT) is signal.default_int_handler:  # else whoever started us ignores it
            signal.signal(signal.SIGINT, leave)  # until a command begins: simdtex.cli.command
        from simdtex.commands import main as command

        command()
    except KeyboardInterrupt:  # of the signal before `leave` took it
        leave()
    except OSError as error:  # of standard output, outside of a command
        from simdtex.cli.command import settle

        settle(error)
    finally:
        try:
            sys.stdout.flush()
        except OSError:  # Python would try again at its end, and end with a code of its own
            os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


if __name__ == "__main__":
    main()
