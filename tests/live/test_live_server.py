"""The server of the live page: access, messages, pages that lose their connection, and the command."""

import http.client
import json
import os
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from contextlib import ExitStack, contextmanager
from contextlib import closing as closing_of

import pytest
from click.testing import CliRunner
from live import asked, png, texture
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.sync.client import connect

from simdtex import commands as cli
from simdtex.live import server as serving
from simdtex.live import session as sessions
from simdtex.live.server import TOKEN, Pages, is_own_name, listen, serve
from simdtex.machine import open_machine

SECRET = "a-token-of-the-tests"
OPEN = ExitStack()  # connections, which are closed when a test ends


@contextmanager
def running(address="127.0.0.1"):
    """A server in this process; its port, and its pages."""
    pages = Pages(open_machine("reference"))
    with listen(pages, SECRET, address, 0) as port:
        yield port, pages


@pytest.fixture
def port():
    with running() as (found, _):
        yield found


@pytest.fixture(autouse=True)
def closing():
    with OPEN:
        yield


def get(port, path, **headers):
    connection = http.client.HTTPConnection("127.0.0.1", port, timeout=60)
    connection.request("GET", path, headers={"Host": f"127.0.0.1:{port}"} | headers)
    with closing_of(connection):
        answer = connection.getresponse()
        return answer, answer.read().decode()


class Client:
    """A page's end of a WebSocket."""

    def __init__(self, port, token=SECRET, session=None, host=None, origin=...):
        query = f"?session={session}" if session else ""
        host = host or f"127.0.0.1:{port}"
        origin = f"http://{host}" if origin is ... else origin
        tcp = socket.create_connection(("127.0.0.1", port))
        how = {"sock": tcp, "origin": origin, "max_size": None, "compression": None, "ping_interval": None}
        self.socket = OPEN.enter_context(connect(f"ws://{host}/{token}/socket{query}", **how))
        self.say(kind="hello")
        self.hello = self.wait("hello")[0]
        self.key = self.hello["session"]

    def say(self, *buffers, **message):
        self.socket.send(json.dumps(message | {"buffers": [len(one) for one in buffers]}))
        for one in buffers:
            self.socket.send(one)

    def wait(self, *kinds):
        while True:
            message = json.loads(self.socket.recv(timeout=120))
            buffers = [self.socket.recv(timeout=120) for _ in range(message["buffers"])]
            if message["kind"] == "frame":
                self.say(kind="shown")
            if message["kind"] in kinds:
                return message, buffers


def test_the_page_is_served_to_whoever_knows_the_token(port):
    for name, kind in {"": "text/html", "live.js": "text/javascript", "live.css": "text/css"}.items():
        answer, text = get(port, f"/{SECRET}/{name}")
        assert (answer.status, answer.headers["Content-Type"].split(";")[0]) == (200, kind)
        assert "default-src 'none'" in answer.headers["Content-Security-Policy"]
        assert (answer.headers["Referrer-Policy"], answer.headers["Cache-Control"]) == ("no-referrer", "no-store")
        elsewhere = re.findall(r"https?://[^\s\"'`]*", text)
        assert not elsewhere, "nothing is loaded from elsewhere"


@pytest.mark.parametrize("path", ["/", "/live.js", "/wrong/live.js", f"/{SECRET[:-1]}/", f"/{SECRET}x/", "/%C3%A4/"])
def test_a_wrong_token_is_refused(port, path):
    answer, text = get(port, path)
    assert (answer.status, text) == (403, serving.REFUSED)


@pytest.mark.parametrize("name", ["Host", "Origin", "Sec-WebSocket-Key", "Sec-WebSocket-Version"])
def test_a_header_that_is_given_twice_is_refused(port, name, caplog):
    headers = {
        **{"Host": f"127.0.0.1:{port}", "Origin": f"http://127.0.0.1:{port}", "Upgrade": "websocket"},
        **{"Connection": "Upgrade", "Sec-WebSocket-Version": "13", "Sec-WebSocket-Key": "AAAAAAAAAAAAAAAAAAAAAA=="},
    }
    lines = [f"GET /{SECRET}/socket HTTP/1.1", *(": ".join(one) for one in headers.items()), f"{name}: {headers[name]}"]
    with socket.create_connection(("127.0.0.1", port), timeout=60) as connection:
        connection.sendall("\r\n".join([*lines, "", ""]).encode())
        assert connection.recv(4096).startswith(b"HTTP/1.1 400 ")
    assert not [record for record in caplog.records if record.exc_info]


@pytest.mark.parametrize("name", ["x", "session.py", "..%2fsession.py"])
def test_there_is_nothing_else(port, name):
    assert get(port, f"/{SECRET}/{name}")[0].status == 404


OWN = ["127.0.0.1", "127.0.0.1:80", "localhost", "LOCALHOST:80", "[::1]", "[::1]:80"]
OTHER = [
    "[::1].evil.example",
    "[::1]x:80",
    "[127.0.0.1]",
    "[evil.example]",
    "::1",
    "a@127.0.0.1",
    "localhost.",
    "x/127.0.0.1",
]
OTHER += ["127.0.0.1:", "127.0.0.1:80:90", "127.0.0.1:x", "127.0.0.1]", "2130706433", "evil.example", "evil.example:80"]
OTHER += ["127.0.0.1.evil.example", "192.168.1.5", "[fe80::1]:80", ""]
CASES = [*((host, "127.0.0.1", host in OWN) for host in OWN + OTHER), ("Wall.local:80", "wall.local", True)]
CASES += [(host, "0.0.0.0", host in [*OWN, "192.168.1.5", "[fe80::1]:80"]) for host in OWN + OTHER]


@pytest.mark.parametrize(("host", "address", "own"), CASES)
def test_a_server_has_its_own_names_alone(host, address, own):
    assert is_own_name(host, address) is own


REFUSED = {
    "a host": ({"host": "evil.example"}, 400),
    "no host": ({"host": "x"}, 400),
    "a token": ({"token": "wrong"}, 403),
    **{f"origin {origin}": ({"origin": origin}, 403) for origin in (None, "null", "https://127.0.0.1", "http://x")},
}


@pytest.mark.parametrize("case", REFUSED)
def test_a_socket_needs_the_host_the_token_and_the_origin(port, case):
    wrong, status = REFUSED[case]
    with pytest.raises(InvalidStatus) as refused:
        Client(port, **wrong)
    assert refused.value.response.status_code == status
    assert get(port, f"/{SECRET}/", Host="evil.example")[0].status == 400


def test_a_page_gives_a_picture_and_takes_a_result_away(port):
    page = Client(port)
    assert page.hello["fresh"] and page.hello["device"] == "reference (NumPy)"
    page.say(png(texture()), kind="open", name="a.png")
    assert page.wait("picture")[0]["width"] == 48
    page.say(**asked())
    assert page.wait("result")[0]["result"] == 1
    page.say(kind="download", result=1, name="texture.png")
    message, (data,) = page.wait("file")
    assert message["name"] == "texture.png" and data.startswith(b"\x89PNG")


def test_two_pages_have_nothing_in_common(port):
    first, second = Client(port), Client(port)
    assert first.key != second.key
    for page, seed in ((first, 1), (second, 2)):
        page.say(png(texture(seed=seed)), kind="open", name=f"{seed}.png")
        page.say(**asked(seed=seed))
    assert [page.wait("result")[0]["settings"]["seed"] for page in (first, second)] == [1, 2]
    other = Client(port, session=first.key)  # as a tab that was duplicated asks: the first is still open
    assert other.key not in (first.key, second.key)


def test_a_page_that_was_lost_comes_back_to_its_results(port):
    page = Client(port)
    page.say(png(texture()), kind="open", name="a.png")
    page.say(**asked())
    page.wait("begun")
    page.socket.close()
    for _ in range(100):
        again = Client(port, session=page.key)
        if again.key == page.key:  # the server has heard of it
            break
        again.socket.close()
        time.sleep(0.02)
    assert again.hello["fresh"] is False
    assert again.wait("result")[0]["result"] == 1


def test_pages_are_few_and_those_that_were_lost_give_way(monkeypatch):
    monkeypatch.setattr(serving, "MAX_PAGES", 2)
    with running() as (port, pages):
        first, second = Client(port), Client(port)
        with pytest.raises(ConnectionClosed) as closed:
            Client(port)
        assert closed.value.rcvd.code == serving.TOO_MANY
        first.socket.close()
        while not pages._lost:
            time.sleep(0.01)
        Client(port)
        assert set(pages._sessions) > {second.key} and first.key not in pages._sessions
        second.socket.close()
        while not pages._lost:
            time.sleep(0.01)
        monkeypatch.setattr(serving, "MAX_PAGES", 9)
        pages.join(None, lambda *_: None)
        assert second.key in pages._sessions
        monkeypatch.setattr(serving, "KEPT", -1.0)
        pages.join(None, lambda *_: None)
        assert second.key not in pages._sessions, "it has been lost for too long"


@pytest.mark.parametrize("text", ["", "[", "[]", "3", '{"buffers": "x"}', '{"buffers": 3}', "[" * 10000, b"\xff"])
def test_what_is_no_message_ends_the_connection(port, text):
    page = Client(port)
    page.socket.send(text)
    with pytest.raises(ConnectionClosed) as closed:
        page.wait("hello")
    assert closed.value.rcvd.code == serving.BAD_MESSAGE
    assert Client(port).key, "others go on"


def test_a_message_that_is_too_large_ends_the_connection(monkeypatch):
    monkeypatch.setattr(serving, "MAX_MESSAGE", 2**20)
    with running() as (port, _):
        page = Client(port)
        with pytest.raises(ConnectionClosed) as closed:
            page.socket.send(bytes(2**21))
            page.wait("hello")
        assert closed.value.rcvd is None or closed.value.rcvd.code == 1009  # None: it was still being sent


@pytest.mark.parametrize(
    ("number", "token"), [pytest.param(signal.SIGINT, "", marks=pytest.mark.slow), (signal.SIGTERM, SECRET)]
)
def test_the_command_prints_an_address_serves_it_and_ends(number, token, tmp_path):
    (tmp_path / "wall.png").write_bytes(png(texture()))
    process = subprocess.Popen(
        [sys.executable, "-m", "simdtex", "live", "--no-browser", "--device", "reference", str(tmp_path / "wall.png")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env=os.environ | {TOKEN: token},
    )
    line = process.stdout.readline()
    found = re.fullmatch(r"http://127\.0\.0\.1:(\d+)/([\w-]+)/  \(on reference \(NumPy\); Ctrl-C ends it\)\n", line)
    assert found, line
    assert found[2] == token or (len(found[2]) == 32 and not token)
    assert get(int(found[1]), f"/{found[2]}/")[0].status == 200
    page = Client(int(found[1]), found[2])
    assert page.wait("picture")[0]["name"] == "wall.png"
    page.say(**asked(width=400, height=400))
    page.wait("begun")
    process.send_signal(number)
    output, errors = process.communicate(timeout=60)
    assert (process.returncode, output, errors) == (0, "ended\n", "")
    with pytest.raises(ConnectionClosed):
        page.wait("result")


def test_a_token_is_long(monkeypatch):
    monkeypatch.setenv(TOKEN, "short")
    with pytest.raises(ValueError, match="must be 16 or more letters"):
        serve(None, "reference", "127.0.0.1", 0, lambda *_: None)


def test_what_cannot_be_listened_to_is_said(tmp_path):
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        words = ["live", "--no-browser", "--device", "reference", "--port", str(port)]
        found = CliRunner().invoke(cli.main, words)
    assert found.exit_code == 2
    assert f"cannot listen to 127.0.0.1 port {port}" in found.output
    found = CliRunner().invoke(cli.main, [*words[:4], str(tmp_path / "none.png")])
    assert (found.exit_code, "none.png does not exist" in found.output) == (2, True)


def test_a_missing_package_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "websockets", None)
    found = CliRunner().invoke(cli.main, ["live"])
    assert found.exit_code == 2
    assert "pip install 'simdtex[live]'" in found.output


def soon(found, timeout=60):
    """Wait until something is so."""
    end = time.monotonic() + timeout
    while not found():
        assert time.monotonic() < end, "it is not so in time"
        time.sleep(0.01)


def closed_in_a_run(port, pages):
    """A page that was closed while it made a large result, and its session."""
    page = Client(port)
    session = pages._sessions[page.key]
    page.say(png(texture()), kind="open", name="a.png")
    page.say(**asked(width=2000, height=2000))
    page.wait("begun")
    page.socket.close()
    return page, session


@pytest.mark.slow
def test_the_run_of_a_page_that_is_gone_ends(monkeypatch):
    monkeypatch.setattr(serving, "RUN_KEPT", 0.0)
    with running() as (port, pages):
        page, session = closed_in_a_run(port, pages)
        soon(lambda: session._wanted is None and session._begun is None)
        assert page.key in pages._sessions, "the session is kept"
        monkeypatch.setattr(serving, "KEPT", 0.0)
        soon(lambda: not pages._sessions)
        session._thread.join(60)
        assert not session._thread.is_alive()


@pytest.mark.slow
def test_a_page_that_comes_back_in_time_keeps_its_run(monkeypatch):
    monkeypatch.setattr(serving, "RUN_KEPT", 0.5)
    with running() as (port, pages):
        page, session = closed_in_a_run(port, pages)
        soon(lambda: page.key in pages._lost)
        again = Client(port, session=page.key)
        shown = again.wait("picture")[0]
        assert not shown["new"] and shown["settings"]["width"] == 2000
        time.sleep(1)
        assert session._begun, "the run goes on"


def test_a_file_that_stops_half_way_ends_the_connection_and_others_go_on(monkeypatch):
    monkeypatch.setattr(serving, "PIECE_WAIT", 0.5)
    with running() as (port, _):
        first, second = Client(port), Client(port)
        data = png(texture())
        first.socket.send(json.dumps({"kind": "open", "name": "a.png", "buffers": [len(data)]}))
        first.socket.send(data[:100])
        time.sleep(0.2)
        second.say(data, kind="open", name="b.png")
        with pytest.raises(ConnectionClosed) as closed:
            first.wait("picture")
        assert closed.value.rcvd.reason == "the file has not come in time"
        assert second.wait("picture")[0]["name"] == "b.png"


class Deadly:
    """A name that ends the process which receives it."""

    def __reduce__(self):
        return os._exit, (3,)


def test_a_file_that_crashes_its_reader_is_told():
    with pytest.raises(ValueError, match="ends the process that reads it: save it again as PNG"):
        sessions.read_apart(Deadly(), b"")


def test_a_reading_that_lasts_too_long_is_ended_and_waits_for_no_other_page(monkeypatch, port):
    first, second, read = Client(port), Client(port), sessions.read_apart
    both = threading.Barrier(2)  # which none passes before the other is read too

    def reading(name, data):
        both.wait(60)
        monkeypatch.setattr(sessions, "READ_WAIT", 0.0 if name == "a.png" else 60.0)
        both.wait(60)
        return read(name, data)

    monkeypatch.setattr(sessions, "read_apart", reading)
    for page in (first, second):
        page.say(png(texture()), kind="open", name="b.png")
    assert first.wait("picture")[0]["name"] == second.wait("picture")[0]["name"] == "b.png"
    for page in (first, second):
        page.say(png(texture()), kind="open", name="a.png")
    assert "a.png cannot be read within 0 s" in first.wait("error")[0]["text"] and second.wait("error")


def test_a_server_ends_while_a_file_is_read_and_a_page_does_not_read(monkeypatch):
    entered, never = threading.Event(), threading.Event()
    monkeypatch.setattr(sessions, "read_apart", lambda *_: (entered.set(), never.wait()))
    monkeypatch.setattr(serving, "ENDING", 0.2)
    with running() as (port, pages):
        page, deaf = Client(port), Client(port)
        page.say(png(texture()), kind="open", name="a.png")
        entered.wait()
        send, large = pages._sessions[deaf.key].send, bytes(2**27)
        sending = threading.Thread(target=send, args=({"kind": "file"}, [large]), daemon=True)
        sending.start()
    sending.join()
    never.set()


@pytest.mark.parametrize("sizes", [[0], [-1], ["x"], [2**27 + 1], [4, 4]])
def test_sizes_of_files_are_checked(port, sizes):
    page = Client(port)
    with pytest.raises(ConnectionClosed) as closed:
        page.socket.send(json.dumps({"kind": "open", "name": "a.png", "buffers": sizes}))
        for _ in sizes:
            page.socket.send(bytes(4))
        while True:
            page.wait("error")
    assert closed.value.rcvd.code == serving.BAD_MESSAGE


def test_few_small_messages_wait(monkeypatch):
    monkeypatch.setattr(sessions, "MAX_QUEUE", 4)
    with running() as (port, pages):
        page = Client(port)
        session = pages._sessions[page.key]
        page.say(png(texture()), kind="open", name="a.png")
        page.wait("picture")
        holding = threading.Event()
        monkeypatch.setattr(session, "_on_pause", lambda *_: holding.wait(5))
        most = 0
        for kind in ["pause", *["resume"] * 40]:
            page.say(kind=kind)
        end = time.monotonic() + 1
        while time.monotonic() < end:
            most = max(most, session._messages.qsize())
        holding.set()
        assert 0 < most <= 4


def test_the_address_without_its_last_slash_leads_to_the_page(port):
    answer, _ = get(port, f"/{SECRET}")
    assert (answer.status, answer.headers["Location"]) == (308, f"/{SECRET}/")
